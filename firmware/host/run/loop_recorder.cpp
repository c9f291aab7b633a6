#include "firmware/host/run/loop_recorder.hpp"

#include <array>
#include <string_view>

namespace cutforce::firmware::host {
namespace {

constexpr std::array<std::string_view, 10> kBlocks{
    "the sample gate",    "the front end",
    "the signal checks",  "the idle calibration",
    "the fused observer", "the torque path",
    "the load friction",  "the cutting force",
    "the controller",     "the periods of estimate and control"};

}  // namespace

hal::host::InputError loop_refused(const ConfigurationFailure& failure, const std::string& where) {
  switch (failure.error) {
    case ConfigurationError::kSampleRate:
      return {where, "the sample rate is not known", "give sample_rate_hz in section [signals]"};
    case ConfigurationError::kPolePairs:
      return {where, "pole_pairs is missing", "give pole_pairs in section [motor]"};
    case ConfigurationError::kRating:
      return {where, "rated power or torque is missing",
              "give rated_power_w and rated_torque_nm in section [motor]"};
    case ConfigurationError::kEstimatePeriod:
      return {where, "the estimate period is not a whole number of samples",
              "give estimate_period_s as a multiple of 1 / sample_rate_hz"};
    case ConfigurationError::kControlPeriod:
      return {where, "the control period is not a whole number of estimate periods",
              "give control_period_s as a multiple of estimate_period_s"};
    case ConfigurationError::kBlock:
      break;
  }
  return {where,
          std::string(kBlocks[static_cast<std::size_t>(failure.block)]) +
              " cannot work with these parameters",
          "compare them with the defaults of cutforce check --template"};
}

std::expected<ControlLoop, hal::host::InputError> loop_for(const Machine& machine,
                                                           const std::string& where) {
  auto loop = make_loop(machine);
  if (!loop) return std::unexpected{loop_refused(loop.error(), where)};
  return *loop;
}

std::expected<LoopRecorder, hal::host::InputError> LoopRecorder::create(
    const std::filesystem::path& trace, TraceRows rows) {
  auto writer = TraceWriter::create(trace);
  if (!writer) return std::unexpected{writer.error()};
  return LoopRecorder{std::move(*writer), rows};
}

std::expected<void, hal::host::InputError> LoopRecorder::finish() {
  if (failed_) return std::unexpected{*failed_};
  return trace_.finish();
}

}  // namespace cutforce::firmware::host
