#include "support/lockstep_board.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <bit>
#include <cstring>
#include <stdexcept>

namespace cutforce::host_tests {
namespace {

using hal::LockstepRecord;

// Far beyond any answer: what does not come at all is to end the test.
constexpr int kPatience_ms = 60'000;

[[noreturn]] void fail(const std::string& what) { throw std::runtime_error("lockstep: " + what); }

}  // namespace

LockstepSocket::LockstepSocket(const std::filesystem::path& path)
    : listening_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.size() >= sizeof(address.sun_path)) fail("the socket's path is too long");
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  if (listening_ < 0 ||
      ::bind(listening_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      ::listen(listening_, 1) != 0) {
    fail("there is no socket at " + text);
  }
}

LockstepSocket::~LockstepSocket() {
  if (peer_ >= 0) ::close(peer_);
  if (listening_ >= 0) ::close(listening_);
}

void LockstepSocket::wait(int descriptor) const {
  pollfd waiting{.fd = descriptor, .events = POLLIN, .revents = 0};
  if (::poll(&waiting, 1, kPatience_ms) <= 0) fail("the board does not answer");
}

void LockstepSocket::accept() {
  wait(listening_);
  peer_ = ::accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC);
  if (peer_ < 0) fail("the board does not connect");
}

void LockstepSocket::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::send(peer_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count <= 0) fail("the board has gone");
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

void LockstepSocket::read(std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    wait(peer_);
    const ssize_t count = ::recv(peer_, bytes.data(), bytes.size(), 0);
    if (count <= 0) fail("the board has gone");
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

LockstepBoard::LockstepBoard(LockstepSocket& socket, const firmware::Machine& machine,
                             std::uint8_t node, float voltage_full_scale_v,
                             float current_full_scale_a)
    : socket_(socket) {
  if (read_record() != LockstepRecord::kListening) fail("the board says something else");
  const hal::LockstepHello hello{.magic = hal::LockstepHello::kMagic,
                                 .machine_bytes = sizeof(machine),
                                 .node = node,
                                 .voltage_full_scale_v = voltage_full_scale_v,
                                 .current_full_scale_a = current_full_scale_a};
  socket_.write(std::as_bytes(std::span(&hello, 1)));
  socket_.write(std::as_bytes(std::span(&machine, 1)));
  if (read_record() != LockstepRecord::kReady) fail("the board refuses the machine");
}

std::optional<firmware::LoopOutput> LockstepBoard::receive(const hal::can::Frame& frame,
                                                           std::int64_t) {
  add(LockstepRecord::kFrame, hal::lockstep_bytes(frame));
  return std::nullopt;
}

auto LockstepBoard::tick(std::int64_t now_ns, const firmware::BoardHealth&) -> Answer {
  add(LockstepRecord::kTick, std::bit_cast<hal::LockstepTimeBytes>(now_ns));
  flush();
  Answer answer;
  for (;;) {
    const LockstepRecord record = read_record();
    if (record == LockstepRecord::kTick) return answer;
    if (record != LockstepRecord::kFrame || answer.frame) fail("no answer of a board");
    hal::LockstepFrameBytes bytes{};
    socket_.read(std::as_writable_bytes(std::span(bytes)));
    answer.frame = hal::lockstep_frame(bytes);
  }
}

void LockstepBoard::end() {
  add(LockstepRecord::kEnd, {});
  flush();
}

void LockstepBoard::add(LockstepRecord record, std::span<const std::uint8_t> bytes) {
  unsent_.push_back(static_cast<std::byte>(record));
  const auto more = std::as_bytes(bytes);
  unsent_.insert(unsent_.end(), more.begin(), more.end());
}

LockstepRecord LockstepBoard::read_record() {
  std::byte byte{};
  socket_.read({&byte, 1});
  return static_cast<LockstepRecord>(byte);
}

void LockstepBoard::flush() {
  socket_.write(unsent_);
  unsent_.clear();
}

}  // namespace cutforce::host_tests
