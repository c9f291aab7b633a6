// What one parameter is: name, unit, range, values, when it may be written, one sentence, and where
// it lives in Machine. Every value is seen as one or three floats: a flag is 0 or 1, a choice is
// the position of its name. So the TOML file, the page of documentation and the CAN index need one
// text.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "firmware/machine.hpp"

namespace cutforce::firmware {

enum class Section : std::uint8_t {
  kSignals,
  kMotor,
  kFriction,
  kSpindle,
  kPowerMeter,
  kEstimator,
  kControl,
  kSupervisor
};
inline constexpr std::array<std::string_view, 8> kSectionNames{
    "signals", "motor", "friction", "spindle", "power_meter", "estimator", "control", "supervisor"};
[[nodiscard]] constexpr std::string_view name_of(Section section) noexcept {
  return kSectionNames[static_cast<std::size_t>(section)];
}

// When a running machine takes a new value.
enum class Write : std::uint8_t {
  kConstruction,  // only before the loop is made: it changes what the blocks are
  kIdle,          // while the tool is out of the cut
  kAnyTime,
};
inline constexpr std::array<std::string_view, 3> kWriteNames{"construction", "idle", "any time"};

enum class Kind : std::uint8_t { kNumber, kWhole, kTriple, kFlag, kChoice };

// The names a person writes for each enumeration, in the enumeration's order.
template <class Enum>
inline constexpr std::span<const std::string_view> kNames{};

namespace detail {
inline constexpr std::array<std::string_view, 2> kWinding{"star", "delta"};
inline constexpr std::array<std::string_view, 2> kVoltage{"line_to_neutral", "line_to_line"};
inline constexpr std::array<std::string_view, 5> kEstimator{"measured", "computed", "synthesized",
                                                            "fused", "dynamometer"};
inline constexpr std::array<std::string_view, 8> kController{
    "none", "pi", "pid", "pole_assignment", "mrac", "variable_gain", "fuzzy", "predictive"};
inline constexpr std::array<std::string_view, 2> kMracForm{"output_error", "state_error"};
inline constexpr std::array<std::string_view, 3> kPower{"dot_product", "two_wattmeter", "fixed_pf"};
inline constexpr std::array<std::string_view, 3> kSpeed{"rotor", "synchronous", "slip"};
inline constexpr std::array<std::string_view, 2> kSwitch{"absolute", "positive_only"};
inline constexpr std::array<std::string_view, 2> kSupervisorMode{"advise", "control"};
inline constexpr std::array<std::string_view, 5> kCode{"binary", "fanuc_fv", "fanuc_ov_10",
                                                       "siemens_gray", "siemens_binary"};
}  // namespace detail

template <>
inline constexpr std::span<const std::string_view> kNames<Winding>{detail::kWinding};
template <>
inline constexpr std::span<const std::string_view> kNames<VoltageKind>{detail::kVoltage};
template <>
inline constexpr std::span<const std::string_view> kNames<EstimatorName>{detail::kEstimator};
template <>
inline constexpr std::span<const std::string_view> kNames<ControllerName>{detail::kController};
template <>
inline constexpr std::span<const std::string_view> kNames<MracForm>{detail::kMracForm};
template <>
inline constexpr std::span<const std::string_view> kNames<SupervisorMode>{detail::kSupervisorMode};
template <>
inline constexpr std::span<const std::string_view> kNames<PowerMode>{detail::kPower};
template <>
inline constexpr std::span<const std::string_view> kNames<SpeedSource>{detail::kSpeed};
template <>
inline constexpr std::span<const std::string_view> kNames<SwitchMode>{detail::kSwitch};
template <>
inline constexpr std::span<const std::string_view> kNames<OverrideCode>{detail::kCode};

struct Parameter {
  std::uint16_t index;  // for CAN: section, then number; once given, never used again
  Section section;
  Kind kind;
  std::string_view key;   // the member's name; no two parameters share it
  std::string_view unit;  // as a person writes it; empty for a pure number
  float minimum;
  float maximum;
  std::string_view zero_means;  // not empty: 0 is also allowed, and means this
  std::array<float, 3> absent;  // value where neither machine file nor recording speaks
  std::array<float, 3> lathe;   // value of the default machine
  Write write;
  std::string_view sentence;
  std::span<const std::string_view> names;  // of a choice
  float (*get)(const Machine&, std::size_t element) noexcept;
  void (*set)(Machine&, std::size_t element, float value) noexcept;

  [[nodiscard]] constexpr std::size_t size() const noexcept {
    return kind == Kind::kTriple ? 3 : 1;
  }

  // False for NaN: every comparison with it is.
  [[nodiscard]] constexpr bool allows(float value) const noexcept {
    if (!zero_means.empty() && value == 0.0F) return true;
    if (!(value >= minimum && value <= maximum)) return false;
    if (kind == Kind::kNumber || kind == Kind::kTriple) return true;
    return value == static_cast<float>(static_cast<std::int32_t>(value));
  }
  // A value that says "not given" says nothing, even where it is written down.
  [[nodiscard]] constexpr bool says_nothing(const Machine& machine) const noexcept {
    return !zero_means.empty() && get(machine, 0) == 0.0F;
  }
};

namespace detail {

template <class T>
struct MemberOf;
template <class T>
struct MemberOf<T Machine::*> {
  using Type = T;
};
template <auto kMember>
using MemberType = typename MemberOf<decltype(kMember)>::Type;
template <auto kMember>
inline constexpr bool kIsTriple = std::is_same_v<MemberType<kMember>, std::array<float, 3>>;

template <auto kMember>
constexpr float get(const Machine& machine, [[maybe_unused]] std::size_t element) noexcept {
  if constexpr (kIsTriple<kMember>) {
    return (machine.*kMember)[element];
  } else {
    return static_cast<float>(machine.*kMember);
  }
}

template <auto kMember>
constexpr void set(Machine& machine, [[maybe_unused]] std::size_t element, float value) noexcept {
  using Type = MemberType<kMember>;
  if constexpr (kIsTriple<kMember>) {
    (machine.*kMember)[element] = value;
  } else if constexpr (std::is_same_v<Type, bool>) {
    machine.*kMember = value != 0.0F;
  } else if constexpr (std::is_enum_v<Type>) {
    machine.*kMember = static_cast<Type>(static_cast<std::uint8_t>(value));
  } else {
    machine.*kMember = value;
  }
}

// One table from two.
template <class T, std::size_t kFirst, std::size_t kSecond>
[[nodiscard]] consteval auto joined(const std::array<T, kFirst>& first,
                                    const std::array<T, kSecond>& second) {
  return [&]<std::size_t... I, std::size_t... J>(std::index_sequence<I...>,
                                                 std::index_sequence<J...>) {
    return std::array<T, kFirst + kSecond>{first[I]..., second[J]...};
  }
  (std::make_index_sequence<kFirst>{}, std::make_index_sequence<kSecond>{});
}

}  // namespace detail
}  // namespace cutforce::firmware
