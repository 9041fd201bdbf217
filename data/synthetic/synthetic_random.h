// Explicitly seeded random numbers that are the same on every platform (std:: distributions are not).
#pragma once

#include <cstdint>

namespace tutti::synthetic {

/// splitmix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", 2014).
/// Two draws never stand in the arguments of one call or on both sides of one operator: which comes first
/// would be the compiler's choice. Each is a constant of its own, in the order in which they are drawn.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t Bits() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  /// In [0, 1).
  double Unit() { return static_cast<double>(Bits() >> 11) * 0x1.0p-53; }
  /// In [low, high).
  double In(double low, double high) { return low + (high - low) * Unit(); }
  /// In low..high, both included.
  int Int(int low, int high) {
    return low + static_cast<int>(Bits() % static_cast<std::uint64_t>(high - low + 1));
  }
  /// Roughly normal with sigma 1: the sum of four uniform numbers.
  float Normal() {
    const std::uint64_t b = Bits();
    const auto part = [b](int shift) { return static_cast<float>((b >> shift) & 0xFFFFU); };
    return (part(0) + part(16) + part(32) + part(48) - 2.0F * 65535.0F) * (1.7320508F / 65535.0F);
  }

 private:
  std::uint64_t state_;
};

}  // namespace tutti::synthetic
