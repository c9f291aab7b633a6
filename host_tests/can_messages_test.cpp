#include "hal/can/messages.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>

#include "hal/can/fields.hpp"
#include "support/allocation_count.hpp"
#include "support/can_signals.hpp"

namespace cutforce::host_tests {
namespace {

using namespace hal::can;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// The arithmetic of the fields, at compile time.
static_assert(code_of(unsigned_field(0, 8), 0.5F) == 1);
static_assert(code_of(unsigned_field(0, 8), 0.49999997F) == 0);
static_assert(code_of(unsigned_field(0, 8), -3.0F) == 0);
static_assert(code_of(unsigned_field(0, 8).without(255), 1e9F) == 254);
static_assert(code_of(signed_field(0, 8), -2.5F) == -3);
static_assert(code_of(signed_field(0, 8).without(-128), -1e9F) == -127);
static_assert(!code_of(unsigned_field(0, 8), kNan));

// Every code of every width that a frame has, with every scale that one has.
TEST(CanFields, LeadFromEveryCodeToAValueAndBack) {
  const Field kFields[] = {
      unsigned_field(3, 16).scaled(1, 2),       unsigned_field(5, 8).scaled(1, 20),
      unsigned_field(6, 8).scaled(1, 100, 100), unsigned_field(1, 16).scaled(1, 100),
      unsigned_field(0, 16).scaled(1, 60000),   unsigned_field(53, 11).scaled(1, 2000),
      signed_field(44, 12).scaled(10, 1),       signed_field(50, 14).scaled(1, 8191),
      signed_field(28, 16).scaled(4, 1),        signed_field(8, 20).scaled(1, 200)};
  for (const Field& field : kFields) {
    for (std::int32_t code = field.minimum; code <= field.maximum; ++code) {
      FieldWriter writer;
      const float value = value_of(field, code);
      writer(field, value);
      FieldReader reader{writer.bytes()};
      float read = kNan;
      reader(field, read);
      ASSERT_EQ(read, value) << field.bits << " " << code;
      ASSERT_EQ(code_of(field, value), code) << field.bits;
    }
  }
}

TEST(CanMessages, HaveTheIdentifiersOfTheirNode) {
  each_message([](const std::string& name, auto message) {
    const auto first = packed(message, 1, 0);
    EXPECT_LE(first.id, 0x7FFU) << name;
    EXPECT_EQ(packed(message, 127, 0).id, first.id + 126) << name;
    EXPECT_FALSE(first.extended || first.remote || first.own) << name;
    EXPECT_EQ(first.length, name == "Heartbeat" ? 1 : 8) << name;
  });
  EXPECT_EQ(pack(Heartbeat{.nmt_state = 5}, 127).id, 0x77FU);
}

TEST(CanMessages, AreRefusedInAnyOtherFormat) {
  each_message([](const std::string& name, auto message) {
    using Message = decltype(message);
    const Frame sound = packed(Message{}, 1, 0);
    ASSERT_TRUE(unpack<Message>(sound).has_value()) << name;
    const auto refused = [&](auto&& how) {
      Frame frame = sound;
      how(frame);
      const auto unpacked = unpack<Message>(frame);
      EXPECT_FALSE(unpacked.has_value()) << name;
      if (!unpacked) {
        EXPECT_EQ(unpacked.error(), FrameError::kFormat) << name;
      }
    };
    refused([](Frame& frame) { frame.extended = true; });
    refused([](Frame& frame) { frame.remote = true; });
    for (unsigned length = 0; length < 256; ++length) {
      if (length == sound.length) continue;
      refused([&](Frame& frame) { frame.length = static_cast<std::uint8_t>(length); });
    }
  });
}

// Too much, too little, and what is no number: known values stay known, at the nearest end.
TEST(CanMessages, SaturateAndNeverSayThatAKnownValueIsNot) {
  for (const float value : {kInfinity, -kInfinity, 3e38F, -3e38F, 70000.0F, -70000.0F}) {
    SCOPED_TRACE(value);
    const Estimate estimate{value, value, value, value, value};
    const auto read = unpack<Estimate>(pack(estimate, 1)).value();
    const bool high = value > 0.0F;
    EXPECT_EQ(read.force_n, high ? 32767.0F : 0.0F);
    EXPECT_EQ(read.force_sigma_n, high ? 2047.0F : 0.0F);
    EXPECT_EQ(read.reference_n, high ? 32767.5F : 0.0F);
    EXPECT_EQ(read.power_w, high ? 20470.0F : -20470.0F);
    EXPECT_EQ(read.stability_margin_ratio, high ? 12.75F - 0.05F : 0.0F);

    const auto job = unpack<Job>(pack(Job{value, value, 255, 255, value}, 1, 0)).value();
    EXPECT_EQ(job.force_reference_n, high ? 16380.0F : 4.0F);
    EXPECT_EQ(job.force_limit_ratio, high ? 3.55F : 1.01F);
    EXPECT_EQ(job.floor_pct, 140);
    EXPECT_EQ(job.ceiling_pct, 250);
    EXPECT_EQ(job.diameter_m, high ? 1.0235F : 0.0005F);

    const auto phases = unpack<Phases>(pack(Phases{9, {value, 0.0F}, {0.0F, value}}, 1)).value();
    EXPECT_EQ(phases.voltage_ratio[0], high ? 1.0F : -1.0F);
    EXPECT_EQ(phases.current_ratio[1], high ? 1.0F : -1.0F);
    EXPECT_EQ(phases.current_ratio[0], 0.0F);
  }
  Override sent{};
  sent.override_pct = 255;
  EXPECT_EQ(unpack<Override>(pack(sent, 1, 0)).value().override_pct, 254);
  MachineState state{};
  state.override_applied_pct = 255;
  state.feed_m_s = 1e9F;
  const auto read = unpack<MachineState>(pack(state, 1, 0)).value();
  EXPECT_EQ(read.override_applied_pct, 254);
  EXPECT_EQ(read.feed_m_s, 65534.0F / 60000.0F);
}

TEST(CanMessages, SayThatWhatIsNotANumberIsNotKnown) {
  const auto estimate = unpack<Estimate>(pack(Estimate{kNan, kNan, kNan, kNan, kNan}, 1)).value();
  EXPECT_FALSE(estimate.force_n || estimate.force_sigma_n || estimate.power_w ||
               estimate.stability_margin_ratio);
  EXPECT_EQ(estimate.reference_n, 0.0F) << "there is no code for it";
  const auto spindle = unpack<Spindle>(pack(Spindle{1, kNan, kNan, 0, false}, 1)).value();
  EXPECT_FALSE(spindle.speed_rad_s || spindle.power_meter_w);
}

TEST(CanMessages, SendTheLowBitsOfCountersAndTheWorstOfTheLoop) {
  const Diagnostics diagnostics{{}, {}, 0xFFFF'FFFF, 0xFFFF'FFFF, 0x1'00U, 0x80'00'01'7FU};
  const auto read = unpack<Diagnostics>(pack(diagnostics, 1)).value();
  EXPECT_EQ(read.worst_loop_us, 65535U);
  EXPECT_EQ(read.refused_frames, 255U);
  EXPECT_EQ(read.unsent_frames, 0U);
  EXPECT_EQ(read.lost_samples, 0x7FU);
}

TEST(CanMessages, RefuseCodesThatTheDbcDoesNotAllow) {
  Frame job = pack(Job{}, 1, 0);
  for (unsigned code = 0; code < 32; ++code) {
    job.data[6] = static_cast<std::uint8_t>((job.data[6] & 0xE0U) | code);
    const auto read = unpack<Job>(job);
    EXPECT_EQ(read.has_value(), code <= 25 || code == 31) << code;
    if (!read) {
      EXPECT_EQ(read.error(), FrameError::kRange);
    }
  }
  Frame heartbeat = pack(Heartbeat{5}, 1);
  heartbeat.data[0] = 128;
  EXPECT_FALSE(unpack<Heartbeat>(heartbeat).has_value());
}

TEST(CanMessages, DoNotLookAtSpareBits) {
  Frame frame = pack(Spindle{7, 12.5F, 400.0F, 3, true}, 1);
  EXPECT_EQ(frame.data[6] >> 5U, 0);
  EXPECT_EQ(frame.data[7], 0);
  frame.data[6] = static_cast<std::uint8_t>(frame.data[6] | 0xE0U);
  frame.data[7] = 0xFF;
  const auto read = unpack<Spindle>(frame).value();
  EXPECT_EQ(read.count, 7);
  EXPECT_EQ(read.speed_rad_s, 12.5F);
  EXPECT_EQ(read.power_meter_w, 400.0F);
  EXPECT_EQ(read.overruns, 3);
  EXPECT_TRUE(read.overload);
  Frame emergency = pack(Emergency{0x8130, 0x11, 7, 3, 250}, 1);
  EXPECT_EQ(emergency.data, (std::array<std::uint8_t, 8>{0x30, 0x81, 0x11, 7, 3, 250, 0, 0}));
  emergency.data[7] = 0xFF;
  EXPECT_EQ(unpack<Emergency>(emergency).value().detail, 250);
}

// What may be on a bus: any bytes. Nothing that is taken is lost by being sent on, nothing that is
// taken is no number, and nothing allocates.
TEST(CanMessages, GiveBackEveryRandomFrameThatTheyTake) {
  std::mt19937_64 random(4);
  const auto allocations = allocation_count();
  int taken = 0;
  for (int k = 0; k < 200'000; ++k) {
    const auto data = std::bit_cast<std::array<std::uint8_t, 8>>(random());
    each_message([&](const char* name, auto message) {
      using Message = decltype(message);
      Frame frame = packed(message, 1, data[2]);
      for (unsigned n = 0; n < frame.length; ++n) frame.data[n] = data[n];
      const auto unpacked = unpack<Message>(frame);
      if (!unpacked) return;
      ++taken;
      message = *unpacked;
      each_signal(message, [](const char*, const auto& value, double) {
        if constexpr (requires { value.has_value(); }) {
          ASSERT_TRUE(!value || std::isfinite(static_cast<float>(*value)));
        }
      });
      const Frame again = packed(message, 1, data[2]);
      const bool guarded = requires { pack(message, 1, 1); };
      for (unsigned n = guarded ? 2 : 0; n < frame.length; ++n) {
        const std::uint64_t spare = std::is_same_v<Message, Spindle>     ? 0xFFE0'0000'0000'0000U
                                    : std::is_same_v<Message, Emergency> ? 0xFF00'0000'0000'0000U
                                                                         : 0U;
        const auto kept = static_cast<std::uint8_t>(~(spare >> (8U * n)));
        ASSERT_EQ(again.data[n], frame.data[n] & kept) << name << " " << n;
      }
    });
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(allocation_count(), allocations);
  EXPECT_GT(taken, 1'000'000);
}

}  // namespace
}  // namespace cutforce::host_tests
