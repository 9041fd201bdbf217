// Records of a long-term memory as bytes for fuzzing: SQLite's own file format is not ours to fuzz.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "loopclosure/store/location_store.h"

namespace tutti::fuzz {

constexpr int kRecordKinds = 5;

/// Stores records of one byte kind, one byte a, two bytes b, two bytes size, content; a last one that is cut
/// off counts with what is there.
inline void WriteRecords(std::string_view records, const std::string& file) {
  constexpr std::size_t kHead = 6;
  internal::LocationStore store(file);
  store.Begin();
  while (records.size() >= kHead) {
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(records[i]); };
    const auto kind = static_cast<internal::LocationStore::Kind>(byte(0) % kRecordKinds);
    const std::string content(records.substr(kHead, byte(4) + 256u * byte(5)));
    store.Put(kind, byte(1), byte(2) + 256 * byte(3), content);
    records.remove_prefix(kHead + content.size());
  }
  store.Commit();
}

/// What WriteRecords makes the same records of.
inline std::string RecordsOf(const std::string& file) {
  internal::LocationStore store(file);
  std::string records;
  for (int kind = 0; kind < kRecordKinds; ++kind) {
    store.ForEach(static_cast<internal::LocationStore::Kind>(kind),
                  [&](std::int64_t a, std::int64_t b, std::string_view content) {
                    for (const std::int64_t value :
                         {std::int64_t{kind}, a, b, b >> 8, static_cast<std::int64_t>(content.size()),
                          static_cast<std::int64_t>(content.size() >> 8)})
                      records += static_cast<char>(value & 255);
                    records += content;
                  });
  }
  return records;
}

}  // namespace tutti::fuzz
