// What one member remembers of one image: which of its words were seen, and how often.
#pragma once

#include <vector>

namespace tutti {

/// Bag of words of one image: z_t of loop-closure.md section 1.
class Signature {
 public:
  /// A word and how often it occurs.
  struct Entry {
    int word = 0;   ///< word id
    int count = 0;  ///< occurrences in the image, at least 1
  };

  Signature() = default;
  /// From one word id per feature, any order; negative ones (words that are not known) are left out.
  explicit Signature(std::vector<int> words);

  /// Unique words, ascending.
  const std::vector<Entry>& entries() const { return entries_; }
  /// |z|: number of quantised features.
  int size() const { return size_; }
  /// True for a bad signature.
  bool empty() const { return size_ == 0; }

  /// Similarity of two signatures (Labbe & Michaud 2013, eq. 1; loop-closure.md section 2):
  /// sum over shared words of min(multiplicity), divided by max(|a|, |b|). In [0, 1]; 0 if one is empty.
  static double Similarity(const Signature& a, const Signature& b);

  /// The parts of a signature that is of several members at once: d_1 + d_2 + ... (loop-closure.md eq. 3).
  /// Its words stay apart by interleaving the ids: word w of part k is word w * parts + k.
  std::vector<Signature> Split(int parts) const;

  template <class Archive>
  void State(Archive& archive);

 private:
  std::vector<Entry> entries_;
  int size_ = 0;
};

}  // namespace tutti
