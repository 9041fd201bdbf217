// Options that are described once, beside the field: the YAML files, --help-config, the range check and the
// API pages take name, default, sentence, unit and range from there.
//
//   struct TrackerOptions {
//     TUTTI_OPTION(int, features, 1500, "features per image", Basic(), From(100));
//     TUTTI_OPTION(double, interval_s, 0.5, "least time between keyframes", Unit("s"), Above(0), To(10));
//     TUTTI_OPTIONS_END;
//   };
//
// is `struct TrackerOptions { int features = 1500; double interval_s = 0.5; };`, a plain aggregate whose
// fields are read and written as ever, and ForEachOption() knows them. One option a line.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#pragma GCC visibility push(default)
namespace tutti {

/// What is said of an option beside its type and default.
struct OptionText {
  const char* name;
  const char* sentence;
  const char* unit = "";     ///< "" for a number without one
  const char* section = "";  ///< of the YAML file, where it is not that of the struct
  bool basic = false;        ///< --help-config shows it without --advanced
  bool in_files = true;      ///< false: for callers of the library alone
  bool has_least = false, least_included = true;
  bool has_most = false, most_included = true;
  double least = 0, most = 0;

  /// "1 to 256", "above 0, at most 1"; "" if every finite number will do.
  std::string Range() const;
  /// Empty if the value is finite and in the range, else "KEY must be RANGE [UNIT], not VALUE".
  std::string Refusal(const std::string& key, double value) const;
};

/// What may follow the sentence in TUTTI_OPTION, in any order.
namespace option_marks {
inline auto Basic() {  // one that users set
  return [](OptionText& o) { o.basic = true; };
}
inline auto CodeOnly() {  // no key in the YAML files
  return [](OptionText& o) { o.in_files = false; };
}
inline auto Section(const char* section) {
  return [section](OptionText& o) { o.section = section; };
}
inline auto Unit(const char* unit) {
  return [unit](OptionText& o) { o.unit = unit; };
}
inline auto Least(double value, bool included) {
  return
      [value, included](OptionText& o) { o.has_least = true, o.least = value, o.least_included = included; };
}
inline auto Most(double value, bool included) {
  return [value, included](OptionText& o) { o.has_most = true, o.most = value, o.most_included = included; };
}
inline auto From(double least) { return Least(least, true); }
inline auto Above(double least) { return Least(least, false); }
inline auto To(double most) { return Most(most, true); }
inline auto Below(double most) { return Most(most, false); }
}  // namespace option_marks

/// The words of the values of an enumeration: WordsOf(Enum), declared beside it, lists them.
template <class Enum>
using EnumWords = std::vector<std::pair<const char*, Enum>>;

/// The word of a value; "?" if it has none.
template <class Enum>
const char* WordOf(Enum value) {
  for (const auto& [word, known] : WordsOf(value)) {
    if (known == value) return word;
  }
  return "?";
}

namespace internal {

template <int kLine>
struct OptionLine {};

template <class... Marks>
OptionText MakeOptionText(const char* name, const char* sentence, const Marks&... marks) {
  OptionText text{name, sentence};
  (marks(text), ...);
  return text;
}

template <class T, class = void>
struct HasOptions : std::false_type {};
template <class T>
struct HasOptions<T, std::void_t<decltype(T::kOptionsEnd)>> : std::true_type {};

template <class Options, class Visitor, int... kLines>
void VisitLines(Options& options, Visitor& visit, std::integer_sequence<int, kLines...>) {
  // No fold expression: clang allows 256 operands.
  const int in_order[] = {(Options::VisitOption(options, visit, OptionLine<kLines>()), 0)...};
  static_cast<void>(in_order);
}

template <class T>
std::string RefusalOf(const OptionText& text, const std::string& key, const T& value) {
  if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>)
    return text.Refusal(key, static_cast<double>(value));
  return "";
}
template <std::size_t N>
std::string RefusalOf(const OptionText& text, const std::string& key, const std::array<double, N>& values) {
  for (const double value : values) {
    std::string refusal = text.Refusal(key, value);
    if (!refusal.empty()) return refusal;
  }
  return "";
}

}  // namespace internal

/// True for a struct whose fields are declared by TUTTI_OPTION.
template <class T>
inline constexpr bool kHasOptions = internal::HasOptions<T>::value;

/// Calls visit(const OptionText&, field) for every option of `options` (const or not) in their order. A field
/// that is a struct of options itself is visited as one.
template <class Options, class Visitor>
void ForEachOption(Options& options, Visitor visit) {
  internal::VisitLines(options, visit, std::make_integer_sequence<int, Options::kOptionsEnd>());
}

/// The first number that is out of its range or not finite, in nested options as well, in words; else empty.
/// `prefix`: what stands before the key in them.
template <class Options>
std::string OutOfRange(const Options& options, const std::string& prefix = "") {
  std::string problem;
  ForEachOption(options, [&](const OptionText& text, const auto& field) {
    if (!problem.empty()) return;
    const std::string key =
        prefix + (*text.section == '\0' ? "" : std::string(text.section) + ".") + text.name;
    if constexpr (kHasOptions<std::decay_t<decltype(field)>>) {
      problem = OutOfRange(field, key + ".");
    } else {
      problem = internal::RefusalOf(text, key, field);
    }
  });
  return problem;
}

}  // namespace tutti
#pragma GCC visibility pop

/// TUTTI_OPTION(type, name, default, sentence, marks...): the field, and what is said of it. A default with
/// commas stands in parentheses.
#define TUTTI_OPTION(type, name, value, ...)                                                           \
  template <class Options, class Visitor>                                                              \
  static void VisitOption(Options& options, Visitor& visit, ::tutti::internal::OptionLine<__LINE__>) { \
    using namespace ::tutti::option_marks; /* NOLINT(google-build-using-namespace) */                  \
    visit(::tutti::internal::MakeOptionText(#name, __VA_ARGS__), options.name);                        \
  }                                                                                                    \
  type name = value /* NOLINT(bugprone-macro-parentheses) */

/// Behind the last of them.
#define TUTTI_OPTIONS_END                                                              \
  template <class Options, class Visitor, int kLine>                                   \
  static void VisitOption(Options&, Visitor&, ::tutti::internal::OptionLine<kLine>) {} \
  static constexpr int kOptionsEnd = __LINE__
