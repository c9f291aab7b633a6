// A bxCAN's registers with the behaviour that RM0090, chapter 32, gives them: what the driver is
// tested against, as nothing here emulates one. The bus is the test's: it delivers frames, and says
// what becomes of those that are sent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

namespace cutforce::host_tests {

class FakeBxCan {
 public:
  struct Mail {
    std::uint32_t id;  // as the mailbox register has it, without TXRQ
    std::uint32_t length;
    std::uint32_t low;
    std::uint32_t high;
  };

  // Knobs of the test.
  bool clocked = true;         // false: INRQ is never acknowledged
  bool bus_idle = true;        // false: leaving initialisation takes for ever
  bool asleep = true;          // as after a reset
  std::uint32_t tec = 0;       // only to tell warning, passive and bus-off
  std::vector<Mail> on_bus{};  // what was requested, in its order

  // A frame from the bus, into FIFO 0 if the filters let it through.
  bool deliver(const Mail& mail) {
    if (initialising() || (at(0x21C) & 1U) == 0 || (at(0x200) & 1U) != 0) return false;
    if (fifo_.size() == 3) {  // RFLM is clear: the last one is overwritten
      fifo_.back() = mail;
      overrun_ = true;
      return true;
    }
    fifo_.push_back(mail);
    return true;
  }
  // The oldest waiting frame leaves, or is retried after an error.
  void send_one() {
    for (const std::size_t box : order_) {
      complete(box, true);
      order_.erase(order_.begin());
      return;
    }
  }
  void error(std::uint32_t code) { last_error_ = code; }
  void go_off() {
    tec = 256;
    off_ = true;
  }
  [[nodiscard]] std::size_t waiting() const { return order_.size(); }
  [[nodiscard]] std::uint32_t bit_timing() const { return at(0x01C); }
  [[nodiscard]] bool in_order() const { return (at(0x000) & 4U) != 0; }
  [[nodiscard]] std::vector<std::string> mistakes() const { return mistakes_; }

  std::uint32_t load(std::size_t offset) {
    switch (offset) {
      case 0x004:
        return (initialising() ? 1U : 0U) | (asleep ? 2U : 0U);
      case 0x008:
        return transmit_status();
      case 0x00C:
        return static_cast<std::uint32_t>(fifo_.size()) | (fifo_.size() == 3 ? 8U : 0U) |
               (overrun_ ? 16U : 0U);
      case 0x018:
        return (tec >= 96 ? 1U : 0U) | (tec >= 128 ? 2U : 0U) | (off_ ? 4U : 0U) | last_error_ << 4;
      case 0x1B0:
        return front().id;
      case 0x1B4:
        return front().length;
      case 0x1B8:
        return front().low;
      case 0x1BC:
        return front().high;
      default:
        return at(offset);
    }
  }

  void store(std::size_t offset, std::uint32_t value) {
    switch (offset) {
      case 0x000:
        return control(value);
      case 0x008:
        return transmit_control(value);
      case 0x00C:
        if ((value & 16U) != 0) overrun_ = false;
        if ((value & 32U) != 0 && !fifo_.empty()) fifo_.pop_front();
        return;
      case 0x018:
        last_error_ = value >> 4 & 7U;
        return;
      case 0x01C:
        if (!initialising()) mistakes_.push_back("bit timing written outside initialisation");
        break;
      case 0x180:
      case 0x190:
      case 0x1A0:
        return request((offset - 0x180) / 16, value);
      case 0x204:
      case 0x20C:
      case 0x214:
        if ((at(0x200) & 1U) == 0) mistakes_.push_back("filter written while the filters run");
        break;
      default:
        break;
    }
    registers_[offset] = value;
  }

 private:
  [[nodiscard]] std::uint32_t at(std::size_t offset) const {
    const auto found = registers_.find(offset);
    if (found != registers_.end()) return found->second;
    return offset == 0x200 ? 0x2A1C0E01U : 0U;  // FMR: the filters start in their initialisation
  }
  [[nodiscard]] bool initialising() const { return initialising_; }
  [[nodiscard]] Mail front() const { return fifo_.empty() ? Mail{} : fifo_.front(); }

  void control(std::uint32_t value) {
    registers_[0x000] = value;
    if (!clocked) return;
    if ((value & 2U) == 0) asleep = false;
    if ((value & 1U) != 0) {
      initialising_ = !asleep;
    } else if (bus_idle) {
      if (initialising_ && off_) off_ = false, tec = 0;  // 128 times eleven recessive bits are over
      initialising_ = false;
    }
  }
  [[nodiscard]] std::uint32_t transmit_status() const {
    std::uint32_t status = 0;
    std::uint32_t next = 3;
    for (std::uint32_t box = 0; box < 3; ++box) {
      status |= (completed_[box] ? 1U : 0U) << (8 * box);
      status |= (sent_[box] ? 2U : 0U) << (8 * box);
      if (pending_[box]) continue;
      status |= 1U << (26 + box);
      if (next == 3) next = box;
    }
    const auto lowest = order_.empty() ? 0U : static_cast<std::uint32_t>(order_.back());
    return status | (next == 3 ? lowest : next) << 24;
  }
  void transmit_control(std::uint32_t value) {
    for (std::uint32_t box = 0; box < 3; ++box) {
      if ((value >> (8 * box) & 1U) != 0) completed_[box] = sent_[box] = false;
      if ((value >> (8 * box) & 0x80U) != 0 && pending_[box]) {
        complete(box, false);
        std::erase(order_, box);
      }
    }
  }
  void request(std::size_t box, std::uint32_t value) {
    if (pending_[box]) mistakes_.push_back("a waiting mailbox was written to");
    const std::size_t base = 0x180 + 16 * box;
    registers_[base] = value;
    if ((value & 1U) == 0) return;
    completed_[box] = sent_[box] = false;
    pending_[box] = true;
    order_.push_back(box);
    on_bus.push_back({value & ~1U, at(base + 4), at(base + 8), at(base + 12)});
  }
  void complete(std::size_t box, bool sent) {
    pending_[box] = false;
    completed_[box] = true;
    sent_[box] = sent;
  }

  std::map<std::size_t, std::uint32_t> registers_{};
  std::deque<Mail> fifo_{};
  std::vector<std::size_t> order_{};
  std::array<bool, 3> pending_{};
  std::array<bool, 3> completed_{};
  std::array<bool, 3> sent_{};
  std::vector<std::string> mistakes_{};
  std::uint32_t last_error_ = 0;
  bool initialising_ = false;
  bool overrun_ = false;
  bool off_ = false;
};

// What a driver holds: it goes where the fake stays.
struct FakeBxCanRegisters {
  FakeBxCan* fake;
  std::uint32_t load(std::size_t offset) const { return fake->load(offset); }
  void store(std::size_t offset, std::uint32_t value) const { fake->store(offset, value); }
};

}  // namespace cutforce::host_tests
