#include "hal/linux/can_bus_monitor.hpp"

#include <gtest/gtest.h>
#include <linux/can/error.h>

#include <array>
#include <cstdint>
#include <random>

namespace cutforce::hal::os {
namespace {

using Data = std::array<std::uint8_t, 8>;
constexpr std::uint32_t kCounters = 0x200;
constexpr std::int64_t kMs = 1'000'000;

CanErrorNews controller(std::uint8_t what) { return read_error_frame(CAN_ERR_CRTL, Data{0, what}); }

TEST(CanErrorFrame, NamesTheStateOfTheController) {
  EXPECT_EQ(controller(CAN_ERR_CRTL_TX_WARNING).state, BusState::kWarning);
  EXPECT_EQ(controller(CAN_ERR_CRTL_RX_WARNING).state, BusState::kWarning);
  EXPECT_EQ(controller(CAN_ERR_CRTL_TX_PASSIVE).state, BusState::kPassive);
  EXPECT_EQ(controller(CAN_ERR_CRTL_RX_PASSIVE).state, BusState::kPassive);
  EXPECT_EQ(controller(CAN_ERR_CRTL_ACTIVE).state, BusState::kActive);
  EXPECT_EQ(read_error_frame(CAN_ERR_BUSOFF, {}).state, BusState::kOff);
}

TEST(CanErrorFrame, OfTwoStatesTakesTheWorse) {
  EXPECT_EQ(controller(CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_RX_PASSIVE).state,
            BusState::kPassive);
  EXPECT_EQ(controller(CAN_ERR_CRTL_ACTIVE | CAN_ERR_CRTL_RX_WARNING).state, BusState::kWarning);
  EXPECT_EQ(read_error_frame(CAN_ERR_BUSOFF | CAN_ERR_CRTL, Data{0, CAN_ERR_CRTL_ACTIVE}).state,
            BusState::kOff);
}

TEST(CanErrorFrame, TellsTheStateByTheCountersWhereItIsNotNamed) {
  const auto counted = [](std::uint8_t transmit, std::uint8_t receive) {
    return read_error_frame(kCounters, Data{0, 0, 0, 0, 0, 0, transmit, receive});
  };
  EXPECT_EQ(counted(95, 0).state, BusState::kActive);
  EXPECT_EQ(counted(96, 0).state, BusState::kWarning);
  EXPECT_EQ(counted(0, 127).state, BusState::kWarning);
  EXPECT_EQ(counted(0, 128).state, BusState::kPassive);
  EXPECT_EQ(counted(255, 0).state, BusState::kPassive);
  EXPECT_EQ(counted(17, 4).counters, (std::array<std::uint8_t, 2>{17, 4}));
}

TEST(CanErrorFrame, DoesNotReadCountersThatAreNotAnnounced) {
  const auto news = read_error_frame(CAN_ERR_BUSERROR, Data{0, 0, 0, 0, 0, 0, 200, 200});
  EXPECT_FALSE(news.state);
  EXPECT_FALSE(news.counters);
}

TEST(CanErrorFrame, KnowsTheMissingAcknowledgeByItsClassAndByItsPlace) {
  EXPECT_TRUE(read_error_frame(CAN_ERR_ACK, {}).no_acknowledge);
  const Data place{0, 0, 0, CAN_ERR_PROT_LOC_ACK};
  EXPECT_TRUE(read_error_frame(CAN_ERR_PROT | CAN_ERR_BUSERROR, place).no_acknowledge);
  EXPECT_FALSE(read_error_frame(CAN_ERR_BUSERROR, place).no_acknowledge);
  EXPECT_FALSE(read_error_frame(CAN_ERR_PROT, Data{0, 0, 0, CAN_ERR_PROT_LOC_DATA}).no_acknowledge);
}

TEST(CanErrorFrame, IsNotSubscribedForLostArbitration) {
  EXPECT_EQ(subscribed_error_classes() & CAN_ERR_LOSTARB, 0U);
  for (const auto wanted : {CAN_ERR_BUSOFF, CAN_ERR_ACK, CAN_ERR_CRTL, CAN_ERR_RESTARTED}) {
    EXPECT_NE(subscribed_error_classes() & wanted, 0U);
  }
}

TEST(CanBusMonitor, WalksFromActiveToOffAsAnUnpluggedNodeDoes) {
  CanBusMonitor monitor(true);
  EXPECT_EQ(monitor.state(), BusState::kActive);
  monitor.error_frame(read_error_frame(CAN_ERR_ACK, {}), 0);
  EXPECT_FALSE(monitor.acknowledged());
  monitor.error_frame(controller(CAN_ERR_CRTL_TX_WARNING), 1);
  EXPECT_EQ(monitor.state(), BusState::kWarning);
  monitor.error_frame(controller(CAN_ERR_CRTL_TX_PASSIVE), 2);
  EXPECT_EQ(monitor.state(), BusState::kPassive);
  EXPECT_TRUE(monitor.usable());
  monitor.error_frame(read_error_frame(CAN_ERR_BUSOFF, {}), 3);
  EXPECT_EQ(monitor.state(), BusState::kOff);
  EXPECT_FALSE(monitor.usable());
  EXPECT_EQ(monitor.error_frames(), 4U);
}

TEST(CanBusMonitor, LeavesOffAndDownOnlyByARestart) {
  std::mt19937 random(1);
  for (const bool off : {true, false}) {
    CanBusMonitor monitor(true);
    if (off) {
      monitor.error_frame(read_error_frame(CAN_ERR_BUSOFF, {}), 0);
    } else {
      monitor.down();
    }
    for (int i = 1; i < 100'000; ++i) {
      Data data{};
      for (auto& byte : data) byte = static_cast<std::uint8_t>(random());
      const auto classes = static_cast<std::uint32_t>(random()) & subscribed_error_classes();
      monitor.error_frame(read_error_frame(classes, data), i * kMs);
      monitor.heard_back(i * kMs);
      ASSERT_FALSE(monitor.usable());
    }
    monitor.restarted();
    EXPECT_EQ(monitor.state(), BusState::kActive);
    EXPECT_TRUE(monitor.acknowledged());
  }
}

TEST(CanBusMonitor, RemembersOffWhenTheInterfaceGoesDownAfterwards) {
  CanBusMonitor monitor(true);
  monitor.error_frame(read_error_frame(CAN_ERR_BUSOFF, {}), 0);
  monitor.down();
  EXPECT_EQ(monitor.state(), BusState::kOff);
}

TEST(CanBusMonitor, TakesAnEchoForAnAcknowledgeOnlyWhereTheControllerGivesIt) {
  CanBusMonitor controller_echo(true);
  CanBusMonitor kernel_echo(false);
  for (auto* monitor : {&controller_echo, &kernel_echo}) {
    monitor->error_frame(read_error_frame(CAN_ERR_ACK, {}), 1000 * kMs);
    monitor->heard_back(1001 * kMs);
  }
  EXPECT_TRUE(controller_echo.acknowledged());
  EXPECT_FALSE(kernel_echo.acknowledged());
  kernel_echo.heard_back(1199 * kMs);
  EXPECT_FALSE(kernel_echo.acknowledged());
  kernel_echo.heard_back(1200 * kMs);  // sent, and for 200 ms no error any more
  EXPECT_TRUE(kernel_echo.acknowledged());
}

TEST(CanBusMonitor, TakesAFrameFromElsewhereForProofOfAReceiver) {
  CanBusMonitor monitor(false);
  monitor.error_frame(read_error_frame(CAN_ERR_ACK, {}), 0);
  EXPECT_FALSE(monitor.acknowledged());
  monitor.foreign_frame(1 * kMs);
  EXPECT_TRUE(monitor.acknowledged());
}

TEST(CanBusMonitor, BelievesNoMissingAcknowledgeWhileSomebodyTalks) {
  CanBusMonitor monitor(false);
  monitor.foreign_frame(1000 * kMs);
  monitor.error_frame(read_error_frame(CAN_ERR_ACK, {}), 1199 * kMs);
  EXPECT_TRUE(monitor.acknowledged());
  monitor.error_frame(read_error_frame(CAN_ERR_ACK, {}), 1200 * kMs);
  EXPECT_FALSE(monitor.acknowledged());
}

TEST(CanBusMonitor, CountsWhatTheControllerLost) {
  CanBusMonitor monitor(true);
  for (int i = 0; i < 3; ++i) monitor.error_frame(controller(CAN_ERR_CRTL_RX_OVERFLOW), i);
  EXPECT_EQ(monitor.controller_overruns(), 3U);
  EXPECT_EQ(monitor.state(), BusState::kActive);
}

}  // namespace
}  // namespace cutforce::hal::os
