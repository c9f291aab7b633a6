#include "hal/host/recording_stream.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "hal/host/binary_recording.hpp"
#include "hal/host/byte_source.hpp"
#include "hal/host/csv_recording.hpp"
#include "hal/host/line_reader.hpp"
#include "hal/host/number_text.hpp"
#include "hal/host/plain_text.hpp"

namespace cutforce::hal::host {
namespace {

constexpr double kNsPerSecond = 1e9;
constexpr double kAgreeingRatio = 0.1;

double median_difference_s(std::span<const Sample> samples) {
  if (samples.size() < 2) return 0.0;
  std::vector<std::int64_t> differences_ns;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    differences_ns.push_back(samples[i].time_ns - samples[i - 1].time_ns);
  }
  const auto middle =
      differences_ns.begin() + static_cast<std::ptrdiff_t>(differences_ns.size() / 2);
  std::nth_element(differences_ns.begin(), middle, differences_ns.end());
  return static_cast<double>(*middle) / kNsPerSecond;
}

// 0 where the metadata declares none.
std::expected<double, InputError> declared_period_s(const RecordingInfo& info) {
  constexpr std::string_view kKey = "sample_rate_hz";
  const auto found = std::find_if(info.metadata.begin(), info.metadata.end(),
                                  [&](const Metadata& entry) { return entry.key == kKey; });
  if (found == info.metadata.end()) return 0.0;
  const char* const begin = found->value.data();
  const char* const end = begin + found->value.size();
  const auto cell = read_number<double>(begin, end);
  const double period_s = 1.0 / cell.value;
  if (cell.state == CellState::kValue && cell.end == end && period_s > 0.0 &&
      std::isfinite(period_s)) {
    return period_s;
  }
  constexpr std::size_t kColumn = 3;  // after '# '
  return std::unexpected{
      error_at(info.file, found->line, kColumn,
               "sample_rate_hz: " + in_quotes(found->value) + " is not a positive number",
               "give the rate in hertz, or leave the line out")};
}

}  // namespace

RecordingStream::RecordingStream(std::unique_ptr<RowSource> rows, std::vector<Sample> samples,
                                 std::vector<Truth> truths)
    : rows_(std::move(rows)),
      first_samples_(std::move(samples)),
      first_truths_(std::move(truths)),
      median_s_(median_difference_s(first_samples_)) {}

auto RecordingStream::open(const std::filesystem::path& path)
    -> std::expected<RecordingStream, InputError> {
  auto source = ByteSource::open(path);
  if (!source) return std::unexpected{source.error()};
  auto rows = source->skip(kBinaryMagic) ? open_binary_recording(std::move(*source))
                                         : open_csv_recording(std::move(*source));
  if (!rows) return std::unexpected{rows.error()};
  std::vector<Sample> samples(kFirstRows);
  std::vector<Truth> truths(kFirstRows);
  const auto count = (*rows)->read(samples, truths);
  if (!count) return std::unexpected{count.error()};
  samples.resize(*count);
  truths.resize(*count);
  return RecordingStream{std::move(*rows), std::move(samples), std::move(truths)};
}

auto RecordingStream::sample_period() const -> std::expected<SamplePeriod, InputError> {
  const auto declared_s = declared_period_s(info());
  if (!declared_s) return std::unexpected{declared_s.error()};
  if (*declared_s == 0.0 && median_s_ == 0.0) {
    return std::unexpected{InputError{.where = info().file,
                                      .what = "the sample period cannot be told from one row",
                                      .remedy = "declare it: '# sample_rate_hz: 5000'"}};
  }
  const bool agrees = median_s_ == 0.0 || (*declared_s >= (1.0 - kAgreeingRatio) * median_s_ &&
                                           *declared_s <= (1.0 + kAgreeingRatio) * median_s_);
  return SamplePeriod{.period_s = *declared_s > 0.0 && agrees ? *declared_s : median_s_,
                      .median_s = median_s_,
                      .declared_s = *declared_s};
}

auto RecordingStream::read(std::span<Sample> samples, std::span<Truth> truths)
    -> std::expected<std::size_t, InputError> {
  const std::size_t ahead = first_samples_.size() - first_read_;
  if (ahead == 0) return rows_->read(samples, truths);
  const std::size_t count = std::min(ahead, samples.size());
  const auto from = static_cast<std::ptrdiff_t>(first_read_);
  std::copy_n(first_samples_.begin() + from, count, samples.begin());
  std::copy_n(first_truths_.begin() + from, count, truths.begin());
  first_read_ += count;
  return count;
}

}  // namespace cutforce::hal::host
