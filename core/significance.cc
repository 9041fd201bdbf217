#include "tutti/core/significance.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <unsupported/Eigen/SpecialFunctions>

#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr int kExactBelow = 25;  // discordant pairs; the customary limit of the chi-square approximation

void CheckLengths(std::size_t a, std::size_t b) {
  if (a == b) return;
  throw InputError("a paired test needs two lists of one length, not " + std::to_string(a) + " and " +
                   std::to_string(b));
}

// P(X <= k) for X ~ B(n, 1/2); n is small.
double BinomialTail(int k, int n) {
  double term = std::pow(0.5, n);  // of 0
  double sum = 0;
  for (int i = 0; i <= k; ++i) {
    sum += term;
    term *= static_cast<double>(n - i) / (i + 1);
  }
  return sum;
}

double IncompleteBeta(double a, double b, double x) {
  using Array1 = Eigen::Array<double, 1, 1>;
  const Array1 value = Eigen::betainc(Array1(a), Array1(b), Array1(x));
  return value(0);
}

}  // namespace

McNemarResult McNemarTest(int only_a, int only_b) {
  McNemarResult result;
  result.only_a = std::max(0, only_a);
  result.only_b = std::max(0, only_b);
  const int fewer = std::min(result.only_a, result.only_b);
  const double sum = static_cast<double>(result.only_a) + result.only_b;
  result.exact = sum < kExactBelow;
  if (result.exact) {
    result.p = std::min(1.0, 2.0 * BinomialTail(fewer, static_cast<int>(sum)));
    return result;
  }
  // Equal counts are no difference: the correction must not make one of them.
  const double difference = std::max(0.0, sum - 2.0 * fewer - 1.0);
  result.chi_square = difference * difference / sum;
  result.p = std::erfc(std::sqrt(0.5 * result.chi_square));  // chi-square of one degree is a squared normal
  return result;
}

McNemarResult McNemarTest(const std::vector<bool>& a, const std::vector<bool>& b) {
  CheckLengths(a.size(), b.size());
  int only_a = 0;
  int only_b = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    only_a += a[i] && !b[i] ? 1 : 0;
    only_b += b[i] && !a[i] ? 1 : 0;
  }
  return McNemarTest(only_a, only_b);
}

PairedTTestResult PairedTTest(const std::vector<double>& a, const std::vector<double>& b) {
  CheckLengths(a.size(), b.size());
  PairedTTestResult result;
  result.pairs = static_cast<int>(a.size());
  const double n = static_cast<double>(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i]) || !std::isfinite(b[i]))
      throw InputError("a paired t-test needs finite numbers; pair " + std::to_string(i) + " has none");
    result.mean_difference += (a[i] - b[i]) / n;
  }
  if (result.pairs < 2) return result;
  double squares = 0;
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = a[i] - b[i];
    squares += (d - result.mean_difference) * (d - result.mean_difference);
    largest = std::max(largest, std::abs(d));
  }
  const double deviation = std::sqrt(squares / (n - 1.0));
  if (largest == 0.0) return result;
  // Below rounding error the differences are all the same.
  if (deviation <= 1e-12 * largest) {
    result.t = std::copysign(std::numeric_limits<double>::infinity(), result.mean_difference);
    result.p = 0;
    return result;
  }
  result.t = result.mean_difference / (deviation / std::sqrt(n));
  result.p = StudentTwoSided(result.t, n - 1.0);
  return result;
}

double StudentTwoSided(double t, double degrees) {
  if (!(degrees > 0)) throw InputError("Student's t needs more than 0 degrees of freedom");
  if (std::isnan(t)) throw InputError("Student's t of a value that is not a number");
  if (std::isinf(t)) return 0;
  return std::clamp(IncompleteBeta(0.5 * degrees, 0.5, degrees / (degrees + t * t)), 0.0, 1.0);
}

}  // namespace tutti
