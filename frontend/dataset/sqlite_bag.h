// Bags of ROS 2 in SQLite (.db3), as 'ros2 bag record' writes them up to Humble: tables "topics" and
// "messages".
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "frontend/dataset/bag.h"

struct sqlite3;

namespace tutti {

class SqliteBag : public Bag {
 public:
  /// Throws InputError where the file can't be opened, or has not these tables.
  explicit SqliteBag(const std::filesystem::path& file);

 private:
  class Query;
  struct Close {
    void operator()(sqlite3* database) const;
  };

  std::string ReadStored(const BagMessage& message) const override;
  void TakeTopics();
  void TakeMessages();

  mutable std::mutex mutex_;
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace tutti
