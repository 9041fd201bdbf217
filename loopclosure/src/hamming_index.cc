#include <algorithm>
#include <random>

#include "distances.h"
#include "tutti/loopclosure/descriptor_index.h"

namespace tutti {
namespace {

constexpr int kKeyBits = 14;      // 16384 buckets a table: a handful of words each at 100,000 words
constexpr int kExactUpTo = 6000;  // below this an exact scan is as fast as the tables

class HammingIndex : public DescriptorIndex {
 public:
  HammingIndex(int bytes, int tables, std::uint64_t seed)
      : bytes_(bytes), tables_(static_cast<std::size_t>(tables)) {
    std::mt19937_64 generator(seed);
    for (Table& table : tables_) {
      table.buckets.resize(std::size_t{1} << kKeyBits);
      for (int& bit : table.bits) {
        bit = static_cast<int>(generator() % static_cast<std::uint64_t>(8 * bytes));
      }
    }
  }

  void Add(const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_8U && rows.cols == bytes_);
    for (int i = 0; i < rows.rows; ++i) {
      const std::uint8_t* row = rows.ptr<std::uint8_t>(i);
      words_.insert(words_.end(), row, row + bytes_);
      for (Table& table : tables_) table.buckets[Key(table, row)].push_back(size_);
      ++size_;
    }
  }

  TwoNearest Search(const std::uint8_t* descriptor) const override {
    return size_ <= kExactUpTo ? SearchAll(descriptor) : SearchTables(descriptor);
  }

  int size() const override { return size_; }

 private:
  struct Table {
    int bits[kKeyBits] = {};
    std::vector<std::vector<int>> buckets;
  };

  static std::size_t Key(const Table& table, const std::uint8_t* row) {
    std::size_t key = 0;
    for (const int bit : table.bits) key = (key << 1) | ((row[bit >> 3] >> (bit & 7)) & 1u);
    return key;
  }

  const std::uint8_t* Word(int index) const {
    return words_.data() + static_cast<std::size_t>(index) * static_cast<std::size_t>(bytes_);
  }

  TwoNearest SearchAll(const std::uint8_t* descriptor) const {
    constexpr int kBlock = 256;
    float distances[kBlock];
    TwoNearest nearest;
    for (int begin = 0; begin < size_; begin += kBlock) {
      const int count = std::min(kBlock, size_ - begin);
      internal::HammingDistances(descriptor, Word(begin), count, bytes_, static_cast<std::size_t>(bytes_),
                                 distances);
      for (int i = 0; i < count; ++i) {
        if (distances[i] < nearest.second_distance) nearest.Offer(begin + i, distances[i]);
      }
    }
    return nearest;
  }

  // Four rounds over all buckets, each asking for the memory that the next one reads: nearly every access
  // misses the caches, and waiting for one at a time would take most of the search.
  TwoNearest SearchTables(const std::uint8_t* descriptor) const {
    constexpr std::size_t kProbes = kKeyBits + 1;
    std::vector<const std::vector<int>*> buckets;
    buckets.reserve(tables_.size() * kProbes);
    for (const Table& table : tables_) {
      const std::size_t key = Key(table, descriptor);
      buckets.push_back(&table.buckets[key]);
      for (int b = 0; b < kKeyBits; ++b) buckets.push_back(&table.buckets[key ^ (std::size_t{1} << b)]);
    }
    for (const std::vector<int>* bucket : buckets) __builtin_prefetch(bucket);
    for (const std::vector<int>* bucket : buckets) __builtin_prefetch(bucket->data());
    std::vector<int> candidates;
    for (const std::vector<int>* bucket : buckets) {
      for (const int i : *bucket) {
        __builtin_prefetch(Word(i));
        candidates.push_back(i);
      }
    }
    return Scan(candidates, descriptor);
  }

  TUTTI_CLONES("popcnt")
  TwoNearest Scan(const std::vector<int>& candidates, const std::uint8_t* descriptor) const;

  int bytes_;
  int size_ = 0;
  std::vector<Table> tables_;
  std::vector<std::uint8_t> words_;
};

TUTTI_CLONES("popcnt")
TwoNearest HammingIndex::Scan(const std::vector<int>& candidates, const std::uint8_t* descriptor) const {
  TwoNearest nearest;
  for (const int i : candidates) {
    const float distance = static_cast<float>(internal::HammingDistance(descriptor, Word(i), bytes_));
    if (distance <= nearest.second_distance) nearest.Offer(i, distance);
  }
  return nearest;
}

}  // namespace

std::unique_ptr<DescriptorIndex> MakeHammingIndex(int bytes, int tables, std::uint64_t seed) {
  return std::make_unique<HammingIndex>(bytes, tables, seed);
}

}  // namespace tutti
