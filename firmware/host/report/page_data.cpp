#include "firmware/host/report/page_data.hpp"

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

namespace cutforce::firmware::host {
namespace {

static_assert(std::endian::native == std::endian::little, "the page reads little-endian numbers");

std::string encoded(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto at = [&](std::size_t k) {
    return k < bytes.size() ? std::to_integer<std::uint32_t>(bytes[k]) : 0U;
  };
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const std::uint32_t group = at(k) << 16 | at(k + 1) << 8 | at(k + 2);
    for (unsigned n = 0; n < 4; ++n)
      out += k + n > bytes.size() ? '=' : kDigits[group >> (18U - 6U * n) & 63U];
  }
  return out;
}

}  // namespace

std::string base64(const std::vector<float>& values) {
  return encoded(std::as_bytes(std::span(values)));
}
std::string base64(const std::vector<double>& values) {
  return encoded(std::as_bytes(std::span(values)));
}

nlohmann::ordered_json grid(const std::vector<double>& time_s) {
  if (time_s.size() > 1) {
    const double step = (time_s.back() - time_s.front()) / static_cast<double>(time_s.size() - 1);
    bool even = true;
    for (std::size_t k = 0; k < time_s.size() && even; ++k)
      even = std::abs(time_s[k] - time_s.front() - step * static_cast<double>(k)) < 0.01 * step;
    if (even) return {{"from_s", time_s.front()}, {"step_s", step}, {"count", time_s.size()}};
  }
  return {{"float64", base64(time_s)}, {"count", time_s.size()}};
}

}  // namespace cutforce::firmware::host
