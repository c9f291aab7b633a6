#include "firmware/cnc_link.hpp"

namespace cutforce::firmware {
namespace {

using hal::Signal;
using hal::can::Base;
using hal::can::identifier;

template <class Message>
void take_guarded(const hal::can::Frame& frame, hal::can::GuardReceiver& guard,
                  std::optional<Message>& last, std::uint32_t& refused, bool& is_new) noexcept {
  if (!guard.take(frame)) {
    ++refused;
    return;
  }
  const auto message = hal::can::unpack<Message>(frame);
  if (!message) {
    ++refused;
    return;
  }
  last = *message;
  is_new = true;
}

void set(std::span<hal::Sample> samples, Signal signal, float hal::Sample::*member,
         float value) noexcept {
  for (hal::Sample& sample : samples) {
    sample.*member = value;
    sample.present |= hal::bit(signal);
  }
}

}  // namespace

void CncLink::take(const hal::can::Frame& frame) noexcept {
  if (frame.own) return;
  bool job_is_new = false;
  if (frame.id == identifier(Base::kMachineState, node_)) {
    take_guarded(frame, state_.machine_guard, state_.machine, state_.refused, state_.is_new);
  } else if (frame.id == identifier(Base::kJob, node_)) {
    take_guarded(frame, state_.job_guard, state_.job, state_.refused, job_is_new);
  } else if (frame.id == identifier(Base::kOverride, node_) ||
             frame.id == identifier(Base::kHeartbeat, node_)) {
    state_.foreign = true;
  }
}

bool CncLink::fetch_new() noexcept {
  const bool is_new = state_.is_new;
  state_.is_new = false;
  return is_new;
}

bool CncLink::fetch_foreign() noexcept {
  const bool foreign = state_.foreign;
  state_.foreign = false;
  return foreign;
}

void CncLink::forget() noexcept {
  state_.machine.reset();
  state_.job.reset();
  state_.is_new = false;
  state_.foreign = false;
}

void CncLink::add_to(std::span<hal::Sample> samples) const noexcept {
  if (state_.machine) {
    const hal::can::MachineState& machine = *state_.machine;
    const bool cutting = machine.cutting_feed && !machine.rapid;
    set(samples, Signal::kFeedActive, &hal::Sample::feed_active, cutting ? 1.0F : 0.0F);
    set(samples, Signal::kPartStart, &hal::Sample::part_start, machine.part_start ? 1.0F : 0.0F);
    if (machine.override_applied_pct) {
      set(samples, Signal::kOverrideApplied, &hal::Sample::override_applied_pct,
          static_cast<float>(*machine.override_applied_pct));
    }
    if (machine.feed_m_s)
      set(samples, Signal::kFeedRate, &hal::Sample::feed_m_s, *machine.feed_m_s);
  }
  if (state_.job && state_.job->diameter_m) {
    set(samples, Signal::kWorkpieceDiameter, &hal::Sample::workpiece_diameter_m,
        *state_.job->diameter_m);
  }
}

}  // namespace cutforce::firmware
