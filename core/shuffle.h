// Orders that are random but the same on every machine.
#pragma once

#include <cstdint>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace tutti::internal {

/// std::shuffle may differ between standard libraries.
inline void Shuffle(std::vector<int>& order, std::mt19937_64& generator) {
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[generator() % i]);
}

/// Shuffles, each time another way, with a state that can be saved.
class Shuffler {
 public:
  /// `number`: of this one among those with the same seed.
  Shuffler(std::uint64_t seed, int number)
      : generator_(seed + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(number)) {}

  void Shuffle(std::vector<int>& order) { internal::Shuffle(order, generator_); }

  template <class Archive>
  void State(Archive& archive) {
    std::stringstream state;
    if constexpr (!Archive::kReading) state << generator_;
    std::string text = state.str();
    archive(text);
    if constexpr (Archive::kReading) {
      state.str(text);
      state >> generator_;
      if (!state) archive.Damaged("the state of a random generator");
    }
  }

 private:
  std::mt19937_64 generator_;
};

}  // namespace tutti::internal
