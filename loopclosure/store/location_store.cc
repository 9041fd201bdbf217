#include "loopclosure/store/location_store.h"

#include <sqlite3.h>

#include <filesystem>
#include <system_error>

#include "core/byte_stream.h"
#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr int kApplicationId = 0x74757474;  // "tutt": what SQLite's header says of whose file it is
constexpr int kSchemaVersion = 5;

// Runs one prepared statement and leaves it ready for the next time, whatever happens.
class Use {
 public:
  explicit Use(sqlite3_stmt* statement) : statement_(statement) {}
  ~Use() {
    sqlite3_reset(statement_);
    sqlite3_clear_bindings(statement_);
  }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;
  void Bind(int index, std::int64_t value) { sqlite3_bind_int64(statement_, index, value); }
  // The bytes must live until the statement has run.
  void Bind(int index, std::string_view bytes) {
    sqlite3_bind_blob64(statement_, index, bytes.empty() ? "" : bytes.data(), bytes.size(), SQLITE_STATIC);
  }
  int Step() { return sqlite3_step(statement_); }
  std::int64_t Integer(int column) { return sqlite3_column_int64(statement_, column); }
  std::string_view Bytes(int column) {
    const void* data = sqlite3_column_blob(statement_, column);
    const int size = sqlite3_column_bytes(statement_, column);
    return data == nullptr ? std::string_view()
                           : std::string_view(static_cast<const char*>(data), Index(size));
  }

 private:
  sqlite3_stmt* statement_;
};

}  // namespace

struct LocationStore::Statements {
  sqlite3_stmt* put = nullptr;
  sqlite3_stmt* get = nullptr;
  sqlite3_stmt* each = nullptr;
  ~Statements() {
    for (sqlite3_stmt* statement : {put, get, each}) sqlite3_finalize(statement);
  }
};

LocationStore::LocationStore(const std::string& file)
    : name_(file.empty() ? "temporary long-term memory" : file), durable_(!file.empty()) {
  const auto close = [this] {
    statements_.reset();
    sqlite3_close(database_);
    database_ = nullptr;
  };
  std::error_code ignored;
  if (std::filesystem::exists(file, ignored) && !std::filesystem::is_regular_file(file, ignored))
    throw InputError(name_ + ": is no file; give the name of a file");
  try {
    const int opened = sqlite3_open_v2(
        file.c_str(), &database_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
    if (opened != SQLITE_OK) Fail(opened, "open");
    sqlite3_extended_result_codes(database_, 1);
    sqlite3_limit(database_, SQLITE_LIMIT_LENGTH, 1 << 28);
    // One process at a time: a second one is told so when it opens the file, not in the middle of a run.
    Execute("PRAGMA locking_mode = EXCLUSIVE");
    const bool is_new = CheckIdentity();
    Execute(durable_ ? "PRAGMA journal_mode = WAL" : "PRAGMA journal_mode = MEMORY");
    Execute(durable_ ? "PRAGMA synchronous = NORMAL" : "PRAGMA synchronous = OFF");
    Execute("PRAGMA cache_size = -4096");
    if (is_new) {
      Begin();
      Execute(
          "CREATE TABLE records (kind INTEGER NOT NULL, a INTEGER NOT NULL, b INTEGER NOT NULL, "
          "crc INTEGER NOT NULL, bytes BLOB NOT NULL, PRIMARY KEY (kind, a, b))");
      Execute(("PRAGMA application_id = " + std::to_string(kApplicationId)).c_str());
      Execute(("PRAGMA user_version = " + std::to_string(kSchemaVersion)).c_str());
      Commit();
    }
    statements_ = std::make_unique<Statements>();
    const auto prepare = [this](const char* sql, sqlite3_stmt** statement) {
      const int code = sqlite3_prepare_v3(database_, sql, -1, SQLITE_PREPARE_PERSISTENT, statement, nullptr);
      if (code != SQLITE_OK) Fail(code, "read");
    };
    prepare("INSERT OR REPLACE INTO records VALUES (?1, ?2, ?3, ?4, ?5)", &statements_->put);
    prepare("SELECT crc, bytes FROM records WHERE kind = ?1 AND a = ?2 AND b = ?3", &statements_->get);
    prepare("SELECT a, b, crc, bytes FROM records WHERE kind = ?1 ORDER BY a, b", &statements_->each);
  } catch (...) {
    close();
    throw;
  }
}

// True if the database is empty, and is to become a memory. A database of another program is not changed.
bool LocationStore::CheckIdentity() {
  Execute("BEGIN IMMEDIATE");
  const std::int64_t id = Number("PRAGMA application_id"), version = Number("PRAGMA user_version"),
                     content = Number("SELECT count(*) FROM sqlite_master");
  Execute("COMMIT");
  if (id == 0 && version == 0 && content == 0) return true;
  if (id != kApplicationId) throw InputError(name_ + ": is a database of another program; give another file");
  if (version != kSchemaVersion) {
    throw InputError(name_ + ": is a long-term memory of version " + std::to_string(version) +
                     ", but this program reads version " + std::to_string(kSchemaVersion) +
                     "; give another file");
  }
  return false;
}

std::int64_t LocationStore::Number(const char* sql) {
  sqlite3_stmt* query = nullptr;
  int code = sqlite3_prepare_v2(database_, sql, -1, &query, nullptr);
  if (code != SQLITE_OK) Fail(code, "read");
  code = sqlite3_step(query);
  const std::int64_t value = code == SQLITE_ROW ? sqlite3_column_int64(query, 0) : 0;
  sqlite3_finalize(query);
  if (code != SQLITE_ROW) Fail(code, "read");
  return value;
}

LocationStore::~LocationStore() {
  statements_.reset();
  sqlite3_close(database_);
}

void LocationStore::Begin() { Execute("BEGIN"); }
void LocationStore::Commit() { Execute("COMMIT"); }

void LocationStore::Rollback() noexcept {
  if (sqlite3_get_autocommit(database_) == 0) {
    sqlite3_exec(database_, "ROLLBACK", nullptr, nullptr, nullptr);
  }
}

void LocationStore::InOneStep(const std::function<void()>& puts) {
  try {
    Begin();
    puts();
    Commit();
  } catch (...) {
    Rollback();
    throw;
  }
}

void LocationStore::Damaged(const std::string& what) const {
  throw InputError(name_ + ": is damaged (" + what + "); give another file, or an older copy");
}

void LocationStore::Put(Kind kind, std::int64_t a, std::int64_t b, std::string_view bytes) {
  Use use(statements_->put);
  use.Bind(1, static_cast<std::int64_t>(kind));
  use.Bind(2, a);
  use.Bind(3, b);
  use.Bind(4, static_cast<std::int64_t>(Crc32(bytes)));
  use.Bind(5, bytes);
  const int code = use.Step();
  if (code != SQLITE_DONE) Fail(code, "write");
}

std::optional<std::string> LocationStore::Get(Kind kind, std::int64_t a, std::int64_t b) {
  Use use(statements_->get);
  use.Bind(1, static_cast<std::int64_t>(kind));
  use.Bind(2, a);
  use.Bind(3, b);
  const int code = use.Step();
  if (code == SQLITE_DONE) return std::nullopt;
  if (code != SQLITE_ROW) Fail(code, "read");
  return Checked(use.Integer(0), use.Bytes(1));
}

void LocationStore::ForEach(Kind kind,
                            const std::function<void(std::int64_t, std::int64_t, std::string_view)>& call) {
  Use use(statements_->each);
  use.Bind(1, static_cast<std::int64_t>(kind));
  while (true) {
    const int code = use.Step();
    if (code == SQLITE_DONE) return;
    if (code != SQLITE_ROW) Fail(code, "read");
    call(use.Integer(0), use.Integer(1), Checked(use.Integer(2), use.Bytes(3)));
  }
}

void LocationStore::LimitPages(int pages) {
  Execute(("PRAGMA max_page_count = " + std::to_string(pages)).c_str());
}

void LocationStore::Clear() { Execute("DELETE FROM records"); }

void LocationStore::Execute(const char* sql) {
  const int code = sqlite3_exec(database_, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) Fail(code, "use");
}

void LocationStore::Fail(int code, const std::string& doing) const {
  const std::string cause =
      database_ != nullptr ? sqlite3_errmsg(database_) : std::string(sqlite3_errstr(code));
  switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw InputError(name_ + ": is in use by another process; wait for it, or give another file");
    case SQLITE_NOTADB:
      throw InputError(name_ + ": is no long-term memory (not an SQLite database); give another file");
    case SQLITE_CORRUPT:
      Damaged(cause);
    case SQLITE_FULL:
      throw InputError(name_ + ": the disk is full; make room, what was stored so far is safe");
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_CANTOPEN:
      throw InputError(name_ + ": can't be written (" + cause + "); check the folder and its permissions");
    default:
      throw InputError(name_ + ": can't " + doing + " the long-term memory (" + cause + ")");
  }
}

std::string LocationStore::Checked(std::int64_t crc, std::string_view bytes) const {
  if (static_cast<std::int64_t>(Crc32(bytes)) != crc) Damaged("a record's checksum is wrong");
  return std::string(bytes);
}

}  // namespace tutti::internal
