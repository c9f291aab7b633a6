#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <string>

#include "firmware/loop_digest.hpp"
#include "hal/sample_stream.hpp"
#include "support/loop_support.hpp"
#include "support/program.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::host_tests {
namespace {

using firmware::Fnv1a;
using firmware::LoopDigest;
using firmware::LoopOutput;
using firmware::Machine;

// The function's own test vectors: of nothing, of "a", of "foobar".
TEST(Fnv1a, GivesItsPublishedValues) {
  EXPECT_EQ(Fnv1a{}.value(), 0xcbf29ce484222325U);
  Fnv1a a;
  a.take('a');
  EXPECT_EQ(a.value(), 0xaf63dc4c8601ec8cU);
  Fnv1a foobar;
  foobar.take(std::array{'f', 'o', 'o', 'b', 'a', 'r'});
  EXPECT_EQ(foobar.value(), 0x85944171f73967e8U);
}

// One bit anywhere in an output changes the hash; what is padding does not count.
TEST(LoopDigest, SeesEveryBitOfEveryField) {
  const LoopOutput zero{};
  LoopDigest same;
  same.take(zero);
  const auto hash_after = [](auto change) {
    LoopOutput output{};
    change(output);
    LoopDigest digest;
    digest.take(output);
    return digest.trace_hash();
  };
  EXPECT_EQ(hash_after([](LoopOutput&) {}), same.trace_hash());
  EXPECT_NE(hash_after([](LoopOutput& o) { o.time_ns = 1; }), same.trace_hash());
  for (const auto field :
       {&LoopOutput::airgap_power_w, &LoopOutput::measured_power_w, &LoopOutput::airgap_torque_nm,
        &LoopOutput::load_torque_nm, &LoopOutput::cutting_torque_nm,
        &LoopOutput::cutting_torque_sigma_nm, &LoopOutput::cutting_force_n,
        &LoopOutput::cutting_force_sigma_n, &LoopOutput::override_pct,
        &LoopOutput::process_gain_n_pct, &LoopOutput::process_gain_sigma_ratio,
        &LoopOutput::stability_margin_ratio}) {
    EXPECT_NE(hash_after([field](LoopOutput& o) { o.*field = -0.0F; }), same.trace_hash());
  }
  EXPECT_NE(hash_after([](LoopOutput& o) { o.present = 1; }), same.trace_hash());
  EXPECT_NE(hash_after([](LoopOutput& o) { o.faults.bits = 1; }), same.trace_hash());
  EXPECT_NE(hash_after([](LoopOutput& o) { o.source = firmware::Source::kFused; }),
            same.trace_hash());
  EXPECT_NE(hash_after([](LoopOutput& o) { o.state = firmware::LoopState::kCut; }),
            same.trace_hash());
  for (const auto flag : {&LoopOutput::control_tick, &LoopOutput::doubtful,
                          &LoopOutput::saturated_low, &LoopOutput::saturated_high}) {
    EXPECT_NE(hash_after([flag](LoopOutput& o) { o.*flag = true; }), same.trace_hash());
  }
}

std::string line_of(const std::string& name, const LoopDigest& digest) {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "%s outputs %u override %016llx trace %016llx\n",
                name.c_str(), digest.outputs(),
                static_cast<unsigned long long>(digest.override_hash()),
                static_cast<unsigned long long>(digest.trace_hash()));
  return text.data();
}

TEST(Hash, IsThatOfTheLoopOverTheRecording) {
  const Recorded recorded = committed_recording("entry_cut");
  auto loop = firmware::make_loop(recorded.machine).value();
  LoopDigest digest;
  for (const hal::Sample& sample : recorded.samples) {
    if (const auto output = loop.step(sample)) {
      digest.take(*output);
      if (output->control_tick) digest.take(loop.command());
    }
  }
  const auto hashed = cutforce_output("hash " + committed("entry_cut"));
  EXPECT_EQ(hashed.exit_status, 0);
  EXPECT_EQ(hashed.output, line_of("entry_cut", digest));
}

TEST(Hash, NamesTheRunByItsChoicesAndWritesItsSamples) {
  const ScratchFolder folder;
  const auto hashed =
      cutforce_output("hash " + committed("entry_cut") +
                      " --estimator computed --controller pi --streams " + q(folder.path()));
  ASSERT_EQ(hashed.exit_status, 0);
  EXPECT_TRUE(hashed.output.starts_with("entry_cut_computed_pi outputs ")) << hashed.output;
  const std::string bytes = bytes_of(folder.file("entry_cut_computed_pi.stream"));
  const Recorded recorded = committed_recording("entry_cut");
  ASSERT_EQ(bytes.size(), sizeof(hal::SampleStreamHeader) + sizeof(Machine) +
                              recorded.samples.size() * sizeof(hal::Sample));
  hal::SampleStreamHeader header{};
  std::memcpy(&header, bytes.data(), sizeof header);
  EXPECT_TRUE(header.fits(sizeof(Machine)));
  EXPECT_FALSE(header.fits(sizeof(Machine) + 4));
  EXPECT_EQ(header.samples, recorded.samples.size());
  Machine machine{};
  std::memcpy(&machine, bytes.data() + sizeof header, sizeof machine);
  EXPECT_EQ(machine.estimator, firmware::EstimatorName::kComputed);
  EXPECT_EQ(machine.controller, firmware::ControllerName::kPi);
  EXPECT_EQ(std::memcmp(bytes.data() + sizeof header + sizeof machine, recorded.samples.data(),
                        recorded.samples.size() * sizeof(hal::Sample)),
            0);
}

TEST(Hash, OfAScenarioIsTheSameEachTime) {
  const std::string command = "hash " + q(in_tests("scenarios/papers/p2_fig09_pi.toml")) + " 2>&1";
  const auto once = cutforce_output(command);
  EXPECT_EQ(once.exit_status, 0) << once.output;
  EXPECT_EQ(once.output, cutforce_output(command).output);
}

TEST(Hash, LeavesNoStreamOfWhatItRefuses) {
  const ScratchFolder folder;
  const auto broken = folder.write("broken.csv", "# cutforce recording 1\nt_s\n0\n");
  const auto refused = cutforce("hash " + q(broken) + " --streams " + q(folder.path()));
  EXPECT_EQ(refused.exit_status, 2) << refused.output;
  EXPECT_EQ(folder.file_count(), 1U);
  EXPECT_EQ(cutforce("hash /nowhere/cut.csv").exit_status, 2);
}

}  // namespace
}  // namespace cutforce::host_tests
