// A CAN adapter in user space behind the kernel's own slcan driver, for what no emulated controller
// can do: no acknowledge, error warnings, bus-off, an adapter that does not read. Runs in the
// guest.
//
//   slcan_adapter WIRE      prints the name of the new interface, then serves until it is killed
//
// WIRE is a vcan interface, the bus on the far side: a test listens and talks there. Frames with
// identifier 7FF on it are commands to the adapter, in characters:
//   noack     the controller has no receiver from now on: what the driver gives it waits
//   ack       somebody is there again: what waits is sent, however old it is
//   deaf      the adapter stops reading what the driver writes, until "hear"
//   hear
//   anything else goes to the driver as it is: e1a, sw000100, sp000130, sb000255 (bus-off)
// A controller that is bus-off hears and sends nothing until the driver opens it again. Opening
// resets it: what it had is gone.
//
// The protocol: drivers/net/can/slcan of the kernel, of Lawicel's CAN232 with error messages.
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sockios.h>
#include <linux/tty.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

namespace {

constexpr canid_t kCommand = 0x7FF;

struct Pty {
  int adapter;  // our end
  int driver;   // held open: the line discipline lives on it
};

void make_raw(int terminal) {
  termios settings{};
  tcgetattr(terminal, &settings);
  cfmakeraw(&settings);
  tcsetattr(terminal, TCSANOW, &settings);
}

std::optional<Pty> open_pty() {
  const int adapter = posix_openpt(O_RDWR | O_NOCTTY);
  if (adapter < 0 || grantpt(adapter) != 0 || unlockpt(adapter) != 0) return std::nullopt;
  const int driver = open(ptsname(adapter), O_RDWR | O_NOCTTY);
  if (driver < 0) return std::nullopt;
  make_raw(driver);
  make_raw(adapter);
  const int discipline = N_SLCAN;
  if (ioctl(driver, TIOCSETD, &discipline) != 0) return std::nullopt;
  std::array<char, IFNAMSIZ> name{};
  if (ioctl(driver, SIOCGIFNAME, name.data()) != 0) return std::nullopt;
  std::printf("%s\n", name.data());
  std::fflush(stdout);
  return Pty{adapter, driver};
}

std::optional<int> open_wire(const char* name) {
  const int wire = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(name));
  if (wire < 0 || address.can_ifindex == 0) return std::nullopt;
  if (bind(wire, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return std::nullopt;
  }
  return wire;
}

class Adapter {
 public:
  Adapter(int pty, int wire) : pty_(pty), wire_(wire) {}

  [[nodiscard]] bool wants_to_read() const { return !deaf_; }

  void read_driver() {
    std::array<char, 256> some{};
    const auto size = read(pty_, some.data(), some.size());
    if (size > 0) text_.append(some.data(), static_cast<std::size_t>(size));
    for (auto end = text_.find('\r'); end != std::string::npos; end = text_.find('\r')) {
      take_line(text_.substr(0, end));
      text_.erase(0, end + 1);
    }
  }

  void read_wire() {
    can_frame frame{};
    if (read(wire_, &frame, sizeof frame) != sizeof frame) return;
    if (frame.can_id == kCommand) {
      command({reinterpret_cast<const char*>(frame.data), frame.len});
    } else if (on_bus()) {
      to_driver(text_of(frame));
    }
  }

 private:
  [[nodiscard]] bool on_bus() const { return open_ && !off_; }

  void take_line(const std::string& line) {
    if (line.empty()) return;
    if (line[0] == 'O' || line[0] == 'C') {
      open_ = line[0] == 'O';
      off_ = false;
      waiting_.clear();
    } else if (line[0] == 't' && on_bus()) {
      waiting_.push_back(frame_of(line));
      if (acknowledged_) send_waiting();
    }
  }

  void command(const std::string& word) {
    if (word == "noack" || word == "ack") {
      acknowledged_ = word == "ack";
      if (acknowledged_) send_waiting();
    } else if (word == "deaf" || word == "hear") {
      deaf_ = word == "deaf";
    } else {
      if (word.starts_with("sb")) off_ = true;
      if (off_) waiting_.clear();
      to_driver(word);
    }
  }

  void send_waiting() {
    for (const can_frame& frame : waiting_) {
      if (write(wire_, &frame, sizeof frame) < 0) std::perror("wire");
    }
    waiting_.clear();
  }

  void to_driver(const std::string& line) const {
    const std::string whole = line + '\r';
    if (write(pty_, whole.data(), whole.size()) < 0) std::perror("pty");
  }

  static std::string text_of(const can_frame& frame) {
    std::array<char, 32> text{};
    int size = std::snprintf(text.data(), text.size(), "t%03X%u", frame.can_id & CAN_SFF_MASK,
                             static_cast<unsigned>(frame.len));
    std::string line(text.data(), static_cast<std::size_t>(size));
    for (unsigned k = 0; k < frame.len; ++k) {
      size = std::snprintf(text.data(), text.size(), "%02X", static_cast<unsigned>(frame.data[k]));
      line.append(text.data(), static_cast<std::size_t>(size));
    }
    return line;
  }

  static can_frame frame_of(const std::string& line) {
    can_frame frame{};
    const auto number = [&line](std::size_t at, std::size_t digits) {
      return static_cast<unsigned>(std::strtoul(line.substr(at, digits).c_str(), nullptr, 16));
    };
    if (line.size() < 5) return frame;
    frame.can_id = number(1, 3);
    frame.len = static_cast<__u8>(number(4, 1) & 0xFU);
    for (unsigned k = 0; k < frame.len && 7 + 2 * k <= line.size(); ++k) {
      frame.data[k] = static_cast<__u8>(number(5 + 2 * k, 2));
    }
    return frame;
  }

  int pty_;
  int wire_;
  std::string text_;
  std::vector<can_frame> waiting_;  // in the controller
  bool open_ = false;
  bool off_ = false;
  bool acknowledged_ = true;
  bool deaf_ = false;
};

}  // namespace

int main(int argc, char** argv) {
  const auto wire = argc == 2 ? open_wire(argv[1]) : std::nullopt;
  const auto pty = wire ? open_pty() : std::nullopt;
  if (!pty) {
    std::fprintf(stderr, "slcan_adapter: no pty, no slcan, or no such WIRE\n");
    return 1;
  }
  Adapter adapter(pty->adapter, *wire);
  while (true) {
    std::array<pollfd, 2> ready{{{*wire, POLLIN, 0}, {pty->adapter, POLLIN, 0}}};
    // The driver's text waits in the pty as long as nobody reads it, and fills it.
    if (!adapter.wants_to_read()) ready[1].fd = -1;
    if (poll(ready.data(), ready.size(), -1) < 0) return 1;
    if ((ready[1].revents & POLLIN) != 0) adapter.read_driver();
    if ((ready[0].revents & POLLIN) != 0) adapter.read_wire();
  }
}
