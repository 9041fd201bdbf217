// Where locations go that leave memory: an SQLite file.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

struct sqlite3;

namespace tutti::internal {

/// Long-term memory's file (loop-closure.md section 1, step 7). Records are bytes with a checksum,
/// under a kind and two numbers. With a write-ahead log: after a crash the file holds everything up to the
/// last commit.
///
/// Every function throws InputError that names the file and says what to do: it can't be opened, is no
/// database, is in use by another process, is damaged, the disk is full.
class LocationStore {
 public:
  enum class Kind : int {
    kMeta = 0,       ///< (0, 0): which configuration the file belongs to
    kNode = 1,       ///< (memory, slot): id, state, weight, links
    kSignature = 2,  ///< (memory, slot): words of every member of that memory
    kView = 3,       ///< (0, slot): what verification needs
    kWord = 4,       ///< (member, word): descriptor
  };

  /// Opens `file`, or makes it where there is none, or an empty one; "" is a temporary one that is gone with
  /// the object.
  explicit LocationStore(const std::string& file);
  ~LocationStore();
  LocationStore(const LocationStore&) = delete;
  LocationStore& operator=(const LocationStore&) = delete;

  /// True if the file has a name: what is committed outlives the process.
  bool durable() const { return durable_; }
  const std::string& name() const { return name_; }

  /// Between Begin and Commit all puts are one step: all of them are stored, or none.
  void Begin();
  void Commit();
  /// Takes back everything since Begin; never throws.
  void Rollback() noexcept;
  /// All that `puts` does as one step. Throws what it throws: then nothing is stored.
  void InOneStep(const std::function<void()>& puts);
  /// Throws InputError: the file is damaged, for `what`.
  [[noreturn]] void Damaged(const std::string& what) const;

  /// Stores a record, in place of an older one.
  void Put(Kind kind, std::int64_t a, std::int64_t b, std::string_view bytes);
  /// Nothing if there is no such record.
  std::optional<std::string> Get(Kind kind, std::int64_t a, std::int64_t b);
  /// Calls for every record of a kind, ascending (a, b).
  void ForEach(Kind kind, const std::function<void(std::int64_t, std::int64_t, std::string_view)>& call);
  /// Makes the store behave as if the disk were full at this many pages (of 4 KiB, as a rule).
  void LimitPages(int pages);
  /// Removes all records.
  void Clear();

 private:
  struct Statements;
  bool CheckIdentity();
  std::int64_t Number(const char* sql);
  void Execute(const char* sql);
  [[noreturn]] void Fail(int code, const std::string& doing) const;
  std::string Checked(std::int64_t crc, std::string_view bytes) const;

  std::string name_;
  bool durable_;
  sqlite3* database_ = nullptr;
  std::unique_ptr<Statements> statements_;
};

}  // namespace tutti::internal
