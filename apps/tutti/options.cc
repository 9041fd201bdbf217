#include "apps/tutti/options.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <system_error>

namespace tutti::cli {
namespace {

constexpr double kMost = 1e15, kLeast = 1e-15;
constexpr long long kMostThreads = 1024;

// What is no number at all is for the conversion to refuse.
std::string RefuseReal(const std::string& text) {
  const char* end = text.data() + text.size();
  double value = 0;
  const auto [last, error] = std::from_chars(text.data() + (text.rfind('+', 0) == 0 ? 1 : 0), end, value);
  if (last != end || error == std::errc::invalid_argument) return {};
  const double size = std::abs(value);
  if (error == std::errc() && (size == 0 || (size >= kLeast && size <= kMost))) return {};
  return "'" + text + "' can't be computed with; give a number of 1e-15 to 1e15 in magnitude, or 0";
}

template <class Whole>
std::string RefuseWhole(const std::string& text) {
  const char* end = text.data() + text.size();
  Whole value = 0;
  const auto [last, error] = std::from_chars(text.data() + (text.rfind('+', 0) == 0 ? 1 : 0), end, value);
  if (last != end || error != std::errc::result_out_of_range) return {};
  const long long least = std::numeric_limits<Whole>::min();
  return "'" + text + "' does not fit; give a whole number from " + std::to_string(least) + " to " +
         std::to_string(std::numeric_limits<Whole>::max());
}

std::string RefuseThreads(const std::string& text) {
  const std::optional<long long> value = ParseInteger(text);
  if (!value || *value <= kMostThreads) return {};
  return "'" + text + "' is more than " + std::to_string(kMostThreads) +
         " threads; as many as cores are enough";
}

}  // namespace

void RefuseAbsurdNumbers(CLI::App& command) {
  for (CLI::Option* option : command.get_options()) {
    const auto refuse = [option](std::string (*problem)(const std::string&)) {
      option->check(CLI::Validator([problem](std::string& text) { return problem(text); }, ""));
    };
    const std::string type = option->get_type_name();
    const std::string kind = type.substr(0, type.find(':'));
    if (kind == "FLOAT" || kind == "SECONDS") refuse(RefuseReal);
    if (kind == "INT") refuse(RefuseWhole<int>);
    if (kind == "UINT") refuse(RefuseWhole<std::uint64_t>);
    if (option->check_lname("threads")) refuse(RefuseThreads);
  }
}

}  // namespace tutti::cli
