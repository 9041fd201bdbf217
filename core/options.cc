#include "tutti/core/options.h"

#include <cmath>
#include <cstdio>

namespace tutti {
namespace {

std::string Number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

}  // namespace

std::string OptionText::Range() const {
  if (has_least && has_most && least_included && most_included) return Number(least) + " to " + Number(most);
  std::string text;
  if (has_least) text = (least_included ? "at least " : "above ") + Number(least);
  if (has_most)
    text += (has_least ? ", " : "") + std::string(most_included ? "at most " : "below ") + Number(most);
  return text;
}

std::string OptionText::Refusal(const std::string& key, double value) const {
  const bool enough = !has_least || value > least || (least_included && value == least);
  const bool too_much = has_most && !(value < most || (most_included && value == most));
  // Squares and cubes of what is nearer to 0 or further from it leave the numbers that a double holds.
  constexpr double kLeast = 1e-30, kMost = 1e30;
  const bool computable = value == 0 || (std::abs(value) >= kLeast && std::abs(value) <= kMost);
  if (std::isfinite(value) && !computable && enough && !too_much)
    return key + " must be 0 or of 1e-30 to 1e30 in magnitude, not " + Number(value);
  if (std::isfinite(value) && enough && !too_much) return "";
  std::string wanted = Range();
  if (wanted.empty()) wanted = "a finite number";
  if (*unit != '\0') wanted += std::string(" [") + unit + "]";
  return key + " must be " + wanted + ", not " + Number(value);
}

}  // namespace tutti
