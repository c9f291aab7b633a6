// Ticks, real-time rights, watchdog and service manager; and what of SocketCAN can be had without
// a CAN bus: its refusals.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <string>

#include "hal/linux/periodic_timer.hpp"
#include "hal/linux/real_time.hpp"
#include "hal/linux/service_notifier.hpp"
#include "hal/linux/socket_can.hpp"
#include "hal/linux/watchdog.hpp"
#include "support/allocation_count.hpp"
#include "support/scratch_folder.hpp"

namespace cutforce::hal::os {
namespace {

TEST(TickSchedule, CountsEveryPeriodThatPassedAndKeepsItsPhase) {
  TickSchedule schedule(1000, 100);
  const auto expect_next = [&](std::int64_t now_ns, std::int64_t due_ns, std::uint32_t missed) {
    const auto tick = schedule.next(now_ns);
    EXPECT_EQ(tick.due_ns, due_ns);
    EXPECT_EQ(tick.missed, missed);
  };
  expect_next(1010, 1100, 0);
  expect_next(1199, 1200, 0);
  expect_next(1300, 1300, 0);  // just in time
  expect_next(1499, 1400, 0);  // late, but within its own period
  expect_next(1600, 1600, 1);
  expect_next(2650, 2600, 9);
  expect_next(2651, 2700, 0);  // never two to catch up
}

TEST(TickSchedule, LosesNoPeriodOverAnyDelays) {
  TickSchedule schedule(0, 100);
  std::int64_t now_ns = 0;
  std::int64_t ticks = 0;
  std::int64_t last_ns = 0;
  for (unsigned i = 0; i < 100'000; ++i) {
    now_ns += (i * 2654435761U >> 20U) % 700;
    const auto tick = schedule.next(now_ns);
    ticks += 1 + std::int64_t{tick.missed};
    ASSERT_GT(tick.due_ns, last_ns);
    ASSERT_EQ(tick.due_ns, ticks * 100);
    now_ns = std::max(now_ns, tick.due_ns);
    last_ns = tick.due_ns;
  }
}

TEST(PeriodicTimer, NeverWakesBeforeItsTimeAndAllocatesNothing) {
  auto timer = PeriodicTimer::start(200'000);
  ASSERT_TRUE(timer);
  const auto before = host_tests::allocation_count();
  for (int i = 0; i < 20; ++i) {
    const auto wake = timer->wait();
    ASSERT_GE(wake.late_ns, 0);
    ASSERT_GE(monotonic_ns(), wake.due_ns);
  }
  EXPECT_EQ(host_tests::allocation_count() - before, 0U);
}

TEST(PeriodicTimer, RefusesAPeriodThatIsNone) {
  for (const std::int64_t period_ns : {std::int64_t{0}, std::int64_t{-1}, INT64_MAX}) {
    EXPECT_FALSE(PeriodicTimer::start(period_ns));
  }
}

TEST(WaitAtLeast, IsNeverShorter) {
  for (const std::int64_t wait_ns : {0, 1'000, 49'000, 51'000, 300'000}) {
    const auto start_ns = monotonic_ns();
    wait_at_least(wait_ns);
    EXPECT_GE(monotonic_ns() - start_ns, wait_ns);
  }
}

TEST(RealTime, IsGrantedOrRefusedInWordsWithARemedy) {
  for (const auto& result : {run_in_real_time(1000), run_in_real_time(-5)}) {
    ASSERT_FALSE(result);
    EXPECT_FALSE(result.error().what.empty());
    EXPECT_FALSE(result.error().remedy.empty());
  }
  const auto latency = WakeupLatency::limit(0, "/nowhere/cpu_dma_latency");
  ASSERT_FALSE(latency);
  EXPECT_NE(latency.error().text().find("/nowhere/cpu_dma_latency"), std::string::npos);
}

TEST(RealTime, WritesTheLatencyAsTheKernelReadsIt) {
  const host_tests::ScratchFolder folder;
  const auto file = folder.write("latency", "");
  const auto latency = WakeupLatency::limit(3, file.c_str());
  ASSERT_TRUE(latency);
  EXPECT_EQ(host_tests::bytes_of(file), std::string("\3\0\0\0", 4));
}

TEST(RealTime, CountsPageFaultsOfThisThread) {
  prefault_stack();
  const auto before = page_faults();
  std::array<volatile unsigned char, 64> touched{};
  touched[3] = 1;
  EXPECT_EQ(page_faults().minor, before.minor);
  const auto pages = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) * 64;
  auto* fresh = static_cast<volatile unsigned char*>(std::malloc(pages * 64));
  ASSERT_NE(fresh, nullptr);
  for (std::size_t i = 0; i < pages * 64; i += 1024) fresh[i] = 1;
  EXPECT_GT(page_faults().minor, before.minor);
  std::free(const_cast<unsigned char*>(fresh));
}

TEST(Watchdog, RefusesWhatIsNoWatchdogAndSaysSo) {
  const host_tests::ScratchFolder folder;
  const auto missing = Watchdog::open(folder.file("watchdog"), 2);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("softdog"), std::string::npos);

  const auto plain = folder.write("plain", "");
  const auto refused = Watchdog::open(plain, 2);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("name a watchdog device"), std::string::npos);
  EXPECT_EQ(host_tests::bytes_of(plain), "V") << "a refused one must not reset the machine";
}

TEST(SocketCan, IsRefusedInWordsWhereThereIsNoSuchInterface) {
  const auto refused = SocketCan::open({.interface = "nocan7", .received = {}, .sent = {}});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("CAN interface nocan7: "), std::string::npos);
  EXPECT_FALSE(refused.error().remedy.empty());
}

// A service manager's end of the socket.
class Manager {
 public:
  explicit Manager(const std::string& name) : socket_(::socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, sizeof address.sun_path - 1);
    if (name[0] == '@') address.sun_path[0] = '\0';
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<sockaddr*>(&address), size), 0);
    ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;
  ~Manager() {
    for (const auto* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(name);
  }

  [[nodiscard]] std::string heard() const {
    std::array<char, 512> text{};
    const auto size = ::recv(socket_.get(), text.data(), text.size(), MSG_DONTWAIT);
    return size < 0 ? "" : std::string(text.data(), static_cast<std::size_t>(size));
  }

 private:
  FileDescriptor socket_;
};

TEST(ServiceNotifier, TellsTheManagerByPathAndByAbstractName) {
  const host_tests::ScratchFolder folder;
  for (const auto& name :
       {folder.file("notify").string(), "@cutforce-test-" + std::to_string(::getpid())}) {
    const Manager manager(name);
    const auto notifier = ServiceNotifier::open();
    ASSERT_TRUE(notifier) << notifier.error().text();
    EXPECT_TRUE(notifier->is_listened_to());
    const auto before = host_tests::allocation_count();
    EXPECT_TRUE(notifier->ready());
    EXPECT_TRUE(notifier->alive());
    EXPECT_TRUE(notifier->status("monitor: 100 %"));
    EXPECT_TRUE(notifier->stopping());
    EXPECT_EQ(host_tests::allocation_count() - before, 0U);
    EXPECT_EQ(manager.heard(), "READY=1");
    EXPECT_EQ(manager.heard(), "WATCHDOG=1");
    EXPECT_EQ(manager.heard(), "STATUS=monitor: 100 %");
    EXPECT_EQ(manager.heard(), "STOPPING=1");
  }
}

TEST(ServiceNotifier, LetsNoStatusSpeakForTheService) {
  const host_tests::ScratchFolder folder;
  const Manager manager(folder.file("notify"));
  const auto notifier = ServiceNotifier::open();
  ASSERT_TRUE(notifier);
  EXPECT_TRUE(notifier->status("well\nREADY=1"));
  EXPECT_EQ(manager.heard(), "STATUS=well");
  EXPECT_TRUE(notifier->status(std::string(1000, 'x')));
  EXPECT_EQ(manager.heard().size(), 207U);
}

TEST(ServiceNotifier, NeverWaitsForAManagerThatDoesNotListen) {
  const host_tests::ScratchFolder folder;
  const Manager manager(folder.file("notify"));
  const auto notifier = ServiceNotifier::open();
  ASSERT_TRUE(notifier);
  bool full = false;
  for (int i = 0; i < 100'000 && !full; ++i) full = !notifier->alive();
  EXPECT_TRUE(full);
}

TEST(ServiceNotifier, KnowsHowOftenItsWatchdogWantsToHear) {
  const host_tests::ScratchFolder folder;
  const Manager manager(folder.file("notify"));
  const auto watchdog = [] { return ServiceNotifier::open().value().watchdog_ns(); };
  EXPECT_EQ(watchdog(), 0);
  ::setenv("WATCHDOG_USEC", "200000", 1);
  EXPECT_EQ(watchdog(), 200'000'000);
  ::setenv("WATCHDOG_PID", "1", 1);
  EXPECT_EQ(watchdog(), 0) << "meant for another process";
  ::setenv("WATCHDOG_PID", std::to_string(::getpid()).c_str(), 1);
  EXPECT_EQ(watchdog(), 200'000'000);
  for (const auto* rubbish : {"", "-1", "2 s", "99999999999999999999"}) {
    ::setenv("WATCHDOG_USEC", rubbish, 1);
    EXPECT_EQ(watchdog(), 0) << rubbish;
  }
}

TEST(ServiceNotifier, IsSilentWithoutAManagerAndRefusesOneThatIsNotThere) {
  ::unsetenv("NOTIFY_SOCKET");
  const auto alone = ServiceNotifier::open();
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->is_listened_to());
  EXPECT_TRUE(alone->ready());
  for (const auto* name : {"/nowhere/notify", "relative", "@nobody-listens-here"}) {
    ::setenv("NOTIFY_SOCKET", name, 1);
    EXPECT_FALSE(ServiceNotifier::open()) << name;
  }
  ::setenv("NOTIFY_SOCKET", ("/" + std::string(500, 'x')).c_str(), 1);
  EXPECT_FALSE(ServiceNotifier::open());
  ::unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace cutforce::hal::os
