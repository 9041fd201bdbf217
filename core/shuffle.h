// Orders that are random but the same on every machine.
#pragma once

#include <cstdint>
#include <random>
#include <sstream>
#include <utility>
#include <vector>

#include "core/byte_stream.h"

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

  void Save(ByteWriter& out) const {
    std::ostringstream state;
    state << generator_;
    out.PutString(state.str());
  }
  /// Throws InputError if it is damaged.
  void Load(ByteReader& in) {
    std::istringstream state(in.GetString());
    state >> generator_;
    if (!state) in.Damaged("the state of a random generator");
  }

 private:
  std::mt19937_64 generator_;
};

}  // namespace tutti::internal
