#include <algorithm>
#include <random>

#include "byte_stream.h"
#include "distances.h"
#include "tutti/loopclosure/descriptor_index.h"
#include "word_storage.h"

namespace tutti {
namespace {

constexpr int kKeyBits = 14;      // 16384 buckets a table: a handful of words each at 100,000 words
constexpr int kExactUpTo = 6000;  // below this an exact scan is as fast as the tables

class HammingIndex : public DescriptorIndex {
 public:
  HammingIndex(int bytes, int tables, std::uint64_t seed)
      : bytes_(bytes), storage_(static_cast<std::size_t>(bytes)), tables_(static_cast<std::size_t>(tables)) {
    std::mt19937_64 generator(seed);
    for (Table& table : tables_) {
      table.buckets.resize(std::size_t{1} << kKeyBits);
      for (int& bit : table.bits) {
        bit = static_cast<int>(generator() % static_cast<std::uint64_t>(8 * bytes));
      }
    }
  }

  void Add(const std::vector<int>& words, const cv::Mat& rows) override {
    CV_Assert(rows.type() == CV_8U && rows.cols == bytes_ &&
              static_cast<std::size_t>(rows.rows) == words.size());
    for (int i = 0; i < rows.rows; ++i) {
      const int word = words[static_cast<std::size_t>(i)];
      if (storage_.RowOf(word) >= 0) continue;
      const int row = storage_.Add(word, rows.ptr(i));
      for (Table& table : tables_) table.buckets[Key(table, rows.ptr(i))].push_back(row);
      ++size_;
    }
  }

  void Remove(int word) override {
    const int row = storage_.RowOf(word);
    if (row < 0) return;
    for (Table& table : tables_) {
      std::vector<int>& bucket = table.buckets[Key(table, storage_.At(row))];
      bucket.erase(std::find(bucket.begin(), bucket.end(), row));
    }
    storage_.Free(row);
    --size_;
  }

  TwoNearest Search(const std::uint8_t* descriptor) const override {
    return size_ <= kExactUpTo ? SearchAll(descriptor) : SearchTables(descriptor);
  }

  void Maintain() override {}  // Remove leaves nothing behind

  const std::uint8_t* Find(int word) const override {
    const int row = storage_.RowOf(word);
    return row < 0 ? nullptr : storage_.At(row);
  }

  int size() const override { return size_; }

  // Which row a word lies in, and the order within a bucket, change no answer: words and descriptors are all.
  void Save(internal::ByteWriter& out) const override {
    out.Put<std::uint64_t>(static_cast<std::uint64_t>(size_));
    for (int row = 0; row < storage_.end(); ++row) {
      if (storage_.WordOf(row) < 0) continue;
      out.Put<std::int32_t>(storage_.WordOf(row));
      out.PutRaw(storage_.At(row), storage_.row_bytes());
    }
  }

  void Load(internal::ByteReader& in) override {
    const std::size_t count = in.GetCount(sizeof(std::int32_t) + storage_.row_bytes());
    cv::Mat descriptor(1, bytes_, CV_8U);
    for (std::size_t i = 0; i < count; ++i) {
      const int word = in.Get<std::int32_t>();
      in.GetRaw(descriptor.data, storage_.row_bytes());
      if (word < 0 || storage_.RowOf(word) >= 0) in.Damaged("a word is there twice");
      Add({word}, descriptor);
    }
  }

 private:
  struct Table {
    int bits[kKeyBits] = {};
    std::vector<std::vector<int>> buckets;  // row numbers
  };

  static std::size_t Key(const Table& table, const std::uint8_t* row) {
    std::size_t key = 0;
    for (const int bit : table.bits) key = (key << 1) | ((row[bit >> 3] >> (bit & 7)) & 1u);
    return key;
  }

  TwoNearest SearchAll(const std::uint8_t* descriptor) const {
    constexpr int kBlock = 256;
    static_assert(internal::WordStorage::kRowsPerBlock % kBlock == 0);
    float distances[kBlock];
    TwoNearest nearest;
    for (int begin = 0; begin < storage_.end(); begin += kBlock) {
      const int count = std::min(kBlock, storage_.end() - begin);
      internal::HammingDistances(descriptor, storage_.At(begin), count, bytes_, storage_.row_bytes(),
                                 distances);
      for (int i = 0; i < count; ++i) {
        if (distances[i] > nearest.second_distance) continue;
        const int word = storage_.WordOf(begin + i);
        if (word >= 0) nearest.Offer(word, distances[i]);
      }
    }
    return nearest;
  }

  TUTTI_CLONES("popcnt")
  void Scan(const std::vector<int>& bucket, const std::uint8_t* descriptor, TwoNearest& nearest) const;

  TwoNearest SearchTables(const std::uint8_t* descriptor) const {
    TwoNearest nearest;
    for (const Table& table : tables_) {
      const std::size_t key = Key(table, descriptor);
      Scan(table.buckets[key], descriptor, nearest);
      for (int b = 0; b < kKeyBits; ++b)
        Scan(table.buckets[key ^ (std::size_t{1} << b)], descriptor, nearest);
    }
    return nearest;
  }

  int bytes_;
  int size_ = 0;
  internal::WordStorage storage_;
  std::vector<Table> tables_;
};

TUTTI_CLONES("popcnt")
void HammingIndex::Scan(const std::vector<int>& bucket, const std::uint8_t* descriptor,
                        TwoNearest& nearest) const {
  for (const int row : bucket) {
    const float distance =
        static_cast<float>(internal::HammingDistance(descriptor, storage_.At(row), bytes_));
    if (distance <= nearest.second_distance) nearest.Offer(storage_.WordOf(row), distance);
  }
}

}  // namespace

std::unique_ptr<DescriptorIndex> MakeHammingIndex(int bytes, int tables, std::uint64_t seed) {
  return std::make_unique<HammingIndex>(bytes, tables, seed);
}

}  // namespace tutti
