// Bags of ROS 2 in SQLite (.db3), as 'ros2 bag record' writes them up to Humble: tables "topics" and
// "messages".
#include <sqlite3.h>

#include <cstdint>
#include <mutex>

#include "frontend/dataset/bag.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

/// A statement that is read row by row. Its first column is the row's number, and its rows are in the order
/// of that: the pages of a damaged file may refer to each other in a ring, in which SQLite walks as good as
/// for ever.
class Query {
 public:
  Query(sqlite3* database, const char* sql) : database_(database) {
    if (sqlite3_prepare_v2(database, sql, -1, &statement_, nullptr) != SQLITE_OK) Fail();
  }
  ~Query() { sqlite3_finalize(statement_); }
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  void Bind(std::int64_t value) { sqlite3_bind_int64(statement_, 1, value); }
  /// False after the last row. Throws InputError where the file is damaged.
  bool Next() {
    const int code = sqlite3_step(statement_);
    if (code == SQLITE_DONE) return false;
    if (code != SQLITE_ROW) Fail();
    if (Number(0) <= last_) throw InputError("rows are not in their order");
    last_ = Number(0);
    return true;
  }
  std::int64_t Number(int column) { return sqlite3_column_int64(statement_, column); }
  std::string Bytes(int column) {
    const void* bytes = sqlite3_column_blob(statement_, column);
    const int size = sqlite3_column_bytes(statement_, column);
    return bytes != nullptr && size > 0
               ? std::string(static_cast<const char*>(bytes), static_cast<std::size_t>(size))
               : std::string();
  }

 private:
  [[noreturn]] void Fail() { throw InputError(sqlite3_errmsg(database_)); }

  sqlite3* database_;
  sqlite3_stmt* statement_ = nullptr;
  std::int64_t last_ = INT64_MIN;
};

class SqliteBag : public Bag {
 public:
  explicit SqliteBag(const std::filesystem::path& path) : Bag(path) {
    const std::string no_bag = path.string() + ": can't be read as a ROS bag: ";
    sqlite3* opened = nullptr;
    const int code =
        sqlite3_open_v2(path.c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, nullptr);
    database_.reset(opened);
    if (code != SQLITE_OK) throw InputError(no_bag + sqlite3_errstr(code));
    sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, static_cast<int>(kMostMessageBytes));
    try {
      // What a stranger put into the file is not run: its views, its triggers, its functions.
      sqlite3_exec(opened, "PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON", nullptr, nullptr,
                   nullptr);
      Query tables(
          opened,
          "SELECT rowid FROM sqlite_master WHERE name IN ('topics', 'messages') AND type = 'table' AND "
          "sql LIKE 'CREATE TABLE%' ORDER BY rowid");
      if (!tables.Next() || !tables.Next())
        throw InputError("it has no tables \"topics\" and \"messages\" as those of 'ros2 bag record' have");
      TakeTopics();
    } catch (const InputError& e) {
      throw InputError(no_bag + e.what());
    }
    TakeMessages();
    ListTopics();
  }

 private:
  void TakeTopics() {
    Query rows(database_.get(),
               "SELECT rowid, id, name, type, serialization_format FROM topics ORDER BY rowid");
    while (rows.Next()) {
      const std::int64_t id = rows.Number(1);
      if (id < 0 || id > UINT32_MAX || rows.Bytes(4) != "cdr") continue;
      AddConnection(static_cast<std::uint32_t>(id),
                    {rows.Bytes(2), NameOfType(rows.Bytes(3)), Serialization::kCdr});
    }
  }

  void TakeMessages() {
    sqlite3_blob* data = nullptr;
    try {
      // Not the data, which would read all of the file, but twelve bytes of each.
      Query rows(database_.get(), "SELECT rowid, topic_id, timestamp FROM messages ORDER BY rowid");
      while (rows.Next()) {
        const std::int64_t row = rows.Number(0), topic = rows.Number(1);
        const int code = data == nullptr
                             ? sqlite3_blob_open(database_.get(), "main", "messages", "data", row, 0, &data)
                             : sqlite3_blob_reopen(data, row);
        MessageHead words = {};
        if (code != SQLITE_OK) {
          sqlite3_blob_close(data);
          data = nullptr;
          if (topic >= 0 && topic <= UINT32_MAX) AddLost(static_cast<std::uint32_t>(topic), 1);
          continue;
        }
        const int size = sqlite3_blob_bytes(data);
        if (topic < 0 || topic > UINT32_MAX || size < static_cast<int>(sizeof words)) continue;
        if (sqlite3_blob_read(data, words.data(), sizeof words, 0) != SQLITE_OK) {
          AddLost(static_cast<std::uint32_t>(topic), 1);
          continue;
        }
        AddMessage({static_cast<std::uint32_t>(topic), static_cast<std::uint32_t>(size),
                    static_cast<std::uint64_t>(row), -1, 0, StampOf(words),
                    1e-9 * static_cast<double>(rows.Number(2))});
      }
    } catch (const InputError& e) {
      NoteDamage(std::string("is damaged, or was cut off while recording (") + e.what() +
                 "); what follows there is not read");
    }
    sqlite3_blob_close(data);
  }

  std::string ReadStored(const BagMessage& message) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    try {
      Query row(database_.get(), "SELECT rowid, data FROM messages WHERE rowid = ?1");
      row.Bind(static_cast<std::int64_t>(message.begin));
      if (row.Next()) return row.Bytes(1);
    } catch (const InputError& e) {
      throw InputError(std::string("a message can't be read (any more): ") + e.what());
    }
    throw InputError("a message can't be read (any more)");
  }

  mutable std::mutex mutex_;
  std::unique_ptr<sqlite3, decltype(&sqlite3_close)> database_{nullptr, sqlite3_close};
};

}  // namespace

std::unique_ptr<Bag> OpenSqliteBag(const std::filesystem::path& file) {
  return std::make_unique<SqliteBag>(file);
}

}  // namespace tutti
