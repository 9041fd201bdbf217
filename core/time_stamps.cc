#include "core/time_stamps.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "core/numbers.h"
#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

constexpr std::array<StampUnit, 4> kUnits = {StampUnit::kSeconds, StampUnit::kMilliseconds,
                                             StampUnit::kMicroseconds, StampUnit::kNanoseconds};
constexpr std::size_t kFew = 4;  // of fewer stamps the spacing tells little

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

double MedianGap(const std::vector<double>& values) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < values.size(); ++i) {
    if (values[i] != values[i - 1]) gaps.push_back(std::abs(values[i] - values[i - 1]));
  }
  return gaps.empty() ? 0 : Median(std::move(gaps));
}

// Clocks of computers: 1985 to 2128.
std::optional<StampUnit> UnitSince1970(double least, double greatest, double gap) {
  constexpr double kFirst = 5e8, kLast = 5e9;  // [s]
  for (const StampUnit unit : kUnits) {
    const double s = SecondsOf(unit);
    const double longest_gap = unit == StampUnit::kSeconds ? 3600 : 10;  // [s]
    if (least * s >= kFirst && greatest * s <= kLast && gap * s <= longest_gap) return unit;
  }
  return std::nullopt;
}

StampUnit UnitOfSingle(double value, StampUnit expected) {
  if (expected != StampUnit::kSeconds || std::abs(value) < 1e11) return expected;
  if (std::abs(value) < 1e14) return StampUnit::kMilliseconds;
  return std::abs(value) < 1e16 ? StampUnit::kMicroseconds : StampUnit::kNanoseconds;
}

// From half a second to half a thousandth between two, for the most part.
RecognisedUnit UnitOfSpacing(double gap, StampUnit expected) {
  if (gap > 1e11) return {expected};
  if (gap > 2e6) return {StampUnit::kNanoseconds};
  if (gap > 2e3) return {StampUnit::kMicroseconds};
  if (gap >= 10) return {StampUnit::kMilliseconds, false};
  return {StampUnit::kSeconds};
}

double Overlap(TimeSpan a, TimeSpan b) {
  const double both = std::min(a.end_s, b.end_s) - std::max(a.begin_s, b.begin_s);
  const double all = std::max(a.end_s, b.end_s) - std::min(a.begin_s, b.begin_s);
  return all > 0 ? std::max(both, 0.0) / all : 0;
}

// A name as text, number, text. `begin` and `end`: of the longest number.
struct NumberedName {
  std::size_t begin = 0, end = 0;
  bool has_point = false;
};

NumberedName LongestNumber(const std::string& name) {
  NumberedName best;
  for (std::size_t i = 0; i < name.size();) {
    if (!IsDigit(name[i])) {
      ++i;
      continue;
    }
    NumberedName number;
    number.begin = i == 1 && name[0] == '-' ? 0 : i;  // elsewhere it parts words
    while (i < name.size() && IsDigit(name[i])) ++i;
    if (i + 1 < name.size() && name[i] == '.' && IsDigit(name[i + 1])) {
      number.has_point = true;
      ++i;
      while (i < name.size() && IsDigit(name[i])) ++i;
    }
    number.end = i;
    if (number.end - number.begin > best.end - best.begin) best = number;
  }
  return best;
}

// A date, say: two numbers make the time.
bool HasOtherNumber(const std::string& text) {
  std::size_t digits = 0;
  for (const char c : text) {
    digits = IsDigit(c) ? digits + 1 : 0;
    if (digits >= 4) return true;
  }
  return false;
}

struct NumberInName {
  std::size_t place = 0;
  double value = 0;
  bool has_point = false;
};

// "20240229235959", and with thousandths: counts in sixties.
bool IsDate(const NumberInName& number) {
  double rest = std::abs(number.value);
  if (rest >= 1e16) rest = std::floor(rest / 1000);
  if (number.has_point || rest < 1970e10 || rest >= 2101e10) return false;
  const auto take = [&](double base) {
    const double part = std::fmod(rest, base);
    rest = std::floor(rest / base);
    return part;
  };
  const double seconds = take(100), minutes = take(100), hours = take(100), day = take(100),
               month = take(100);
  return seconds < 60 && minutes < 60 && hours < 24 && day >= 1 && day <= 31 && month >= 1 && month <= 12;
}

}  // namespace

double SecondsOf(StampUnit unit) {
  static constexpr std::array<double, 4> kSeconds = {1, 1e-3, 1e-6, 1e-9};
  return kSeconds.at(static_cast<std::size_t>(unit));
}

const char* NameOf(StampUnit unit) {
  static constexpr std::array<const char*, 4> kNames = {"seconds", "milliseconds", "microseconds",
                                                        "nanoseconds"};
  return kNames.at(static_cast<std::size_t>(unit));
}

RecognisedUnit UnitOfStamps(const std::vector<double>& values, StampUnit expected) {
  if (values.empty()) return {expected};
  const double gap = MedianGap(values);
  const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
  const std::optional<StampUnit> since_1970 = UnitSince1970(*least, *greatest, gap);
  const bool single =
      gap == 0 && values.front() == std::floor(values.front());  // 1e9 may be one second in ns
  if (since_1970 && !(single && *since_1970 == StampUnit::kSeconds)) return {*since_1970};
  if (gap == 0) return {UnitOfSingle(values.front(), expected)};
  const double expected_gap = gap * SecondsOf(expected);
  if (expected_gap >= 1e-4 && expected_gap < 10) return {expected};
  const bool absurd = expected_gap < 1e-6;  // more than a million images a second
  if (values.size() < kFew && !absurd && (expected != StampUnit::kSeconds || gap < 1e4)) return {expected};
  return UnitOfSpacing(gap, expected);
}

void FitUnit(TimeSpan others, Trajectory& poses, TrajectoryDetails& details,
             std::vector<std::string>* warnings) {
  if (details.unit_is_certain || !details.has_stamps || poses.empty()) return;
  const double factor = 1 / SecondsOf(details.unit);
  const TimeSpan own = {poses.front().stamp_s, poses.back().stamp_s};
  details.unit_is_certain = true;
  if (Overlap({own.begin_s * factor, own.end_s * factor}, others) <= Overlap(own, others)) return;
  const std::string said = UnitNote({}, details.unit, StampUnit::kSeconds);
  const auto says_it = [&](const std::string& warning) {
    return warning.size() > said.size() &&
           warning.compare(warning.size() - said.size(), said.size(), said) == 0;
  };
  if (warnings != nullptr)
    warnings->erase(std::remove_if(warnings->begin(), warnings->end(), says_it), warnings->end());
  for (StampedPose& pose : poses) pose.stamp_s *= factor;
  details.unit = StampUnit::kSeconds;
  details.stamps_ns.clear();
}

std::optional<std::int64_t> NanosecondsOf(std::string_view word, StampUnit unit) {
  const auto decimals = static_cast<std::size_t>(9 - 3 * static_cast<int>(unit));
  std::string_view digits = word;
  const bool negative = !digits.empty() && digits.front() == '-';
  if (negative || (!digits.empty() && digits.front() == '+')) digits.remove_prefix(1);
  const std::size_t point = std::min(digits.find('.'), digits.size());
  const std::string_view fraction = digits.substr(std::min(point + 1, digits.size()));
  std::string whole(digits.substr(0, point));
  whole.append(fraction.substr(0, decimals));
  whole.append(decimals - std::min(decimals, fraction.size()), '0');
  const auto all_digits = [](std::string_view text) {
    return std::all_of(text.begin(), text.end(), IsDigit);
  };
  if (digits.empty() || !all_digits(whole) || !all_digits(fraction)) {  // 1.4e18
    const std::optional<double> value = ParseDouble(word);
    const double nanoseconds = value.value_or(NAN) * SecondsOf(unit) * 1e9;
    if (!(std::abs(nanoseconds) < 9.2e18)) return std::nullopt;
    return std::llround(nanoseconds);
  }
  std::optional<long long> out = ParseInteger(whole);
  if (!out || *out > 9'200'000'000'000'000'000) return std::nullopt;
  if (fraction.size() > decimals && fraction[decimals] >= '5') ++*out;
  return negative ? -*out : *out;
}

std::string StampText(double stamp_s) {
  char text[400];  // of the largest double
  std::snprintf(text, sizeof text, "%.9f", stamp_s);
  return text;
}

std::string StampText(std::int64_t nanoseconds) {
  const auto part = std::lldiv(nanoseconds, 1'000'000'000);
  char text[48];
  std::snprintf(text, sizeof text, "%s%lld.%09lld", nanoseconds < 0 ? "-" : "", std::llabs(part.quot),
                std::llabs(part.rem));
  return text;
}

std::string UnitNote(const std::string& file, StampUnit unit, StampUnit usual) {
  if (unit == usual) return {};
  return file + ": its time stamps are in " + NameOf(unit);
}

StampsOfNames FindStamps(const std::vector<std::string>& names) {
  std::map<std::pair<std::string, std::string>, std::vector<NumberInName>> alike;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const NumberedName number = LongestNumber(names[i]);
    const std::string before = names[i].substr(0, number.begin), after = names[i].substr(number.end);
    const std::optional<double> value =
        ParseDouble(std::string_view(names[i]).substr(number.begin, number.end - number.begin));
    if (!value || HasOtherNumber(before) || HasOtherNumber(after)) continue;
    alike[{before, after}].push_back({i, *value, number.has_point});
  }
  const auto most = std::max_element(alike.begin(), alike.end(), [](const auto& a, const auto& b) {
    return a.second.size() < b.second.size();
  });
  StampsOfNames out;
  if (most == alike.end()) return out;
  std::vector<NumberInName>& numbers = most->second;
  std::stable_sort(numbers.begin(), numbers.end(),
                   [](const NumberInName& a, const NumberInName& b) { return a.value < b.value; });
  std::vector<double> values;
  values.reserve(numbers.size());
  for (const NumberInName& number : numbers) values.push_back(number.value);
  const double greatest = std::max(std::abs(values.front()), std::abs(values.back()));
  const bool has_point =
      std::any_of(numbers.begin(), numbers.end(), [](const auto& n) { return n.has_point; });
  if (!has_point && greatest <= 100 * static_cast<double>(values.size()) + 1e6) return out;
  if (std::all_of(numbers.begin(), numbers.end(), IsDate)) return out;
  if (std::adjacent_find(values.begin(), values.end()) != values.end()) return out;
  out.unit = UnitOfStamps(values).unit;
  for (const NumberInName& number : numbers)
    out.stamps.emplace_back(number.value * SecondsOf(out.unit), number.place);
  return out;
}

}  // namespace tutti::internal
