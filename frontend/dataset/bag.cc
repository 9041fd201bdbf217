#include "frontend/dataset/bag.h"

#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <tuple>

#include "frontend/dataset/chunked_bag.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostBagMessages = 20'000'000;  // 55 hours of 100 Hz
constexpr std::size_t kMostBagParts = 500;            // each is an open file

std::unique_ptr<Bag> OpenBagFile(const fs::path& file) {
  const std::string no_bag = file.string() + ": can't be read as a ROS bag: ";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) throw InputError(no_bag + "it is missing, or no file");
  std::string magic(16, '\0');
  std::ifstream in(file, std::ios::binary);
  if (!in.is_open()) throw InputError(no_bag + "it can't be opened");
  in.read(magic.data(), static_cast<std::streamsize>(magic.size()));
  magic.resize(static_cast<std::size_t>(in.gcount()));
  const auto begins_with = [&](std::string_view text) { return magic.compare(0, text.size(), text) == 0; };
  if (begins_with(kRosBagMagic)) return OpenRosBag(file);
  if (begins_with(kMcapMagic)) return OpenMcapBag(file);
  if (begins_with("SQLite format 3")) return OpenSqliteBag(file);
  if (IsPacked(magic)) throw InputError(no_bag + "it is packed; unpack it: zstd -d");
  throw InputError(
      no_bag +
      "it begins neither with '#ROSBAG V2.0' (ROS 1) nor as MCAP or SQLite (ROS 2: the files that "
      "'ros2 bag record' leaves)");
}

/// A recording in several files.
class PartedBag : public Bag {
 public:
  PartedBag(const fs::path& folder, const std::vector<fs::path>& files) : Bag(folder) {
    if (files.size() > kMostBagParts)
      throw InputError(folder.string() + ": has more than " + std::to_string(kMostBagParts) + " parts");
    for (const fs::path& path : files) {
      try {
        parts_.push_back(OpenBagFile(path));
        Absorb(std::move(*parts_.back()), static_cast<std::uint32_t>(parts_.size() - 1));
      } catch (const InputError& e) {  // the other parts are worth as much
        NoteDamage(std::string("a part is skipped: ") + e.what());
      }
    }
    if (parts_.empty()) throw InputError(damage());
    ListTopics();
  }

 private:
  std::string ReadStored(const BagMessage& message) const override {
    return parts_.at(message.part)->Read(message);
  }

  std::vector<std::unique_ptr<Bag>> parts_;
};

}  // namespace

bool Bag::IsNamed(const fs::path& file) {
  const auto endings = {".bag", ".mcap", ".db3", ".zstd"};
  return std::find(endings.begin(), endings.end(), file.extension().string()) != endings.end();
}

std::vector<fs::path> Bag::Files(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string type = at->path().extension().string();
    std::error_code none;
    const bool packed = type == ".zstd" && !fs::exists(folder / at->path().stem(), none);
    const std::string kind = packed ? at->path().stem().extension().string() : type;
    if ((kind == ".mcap" || kind == ".db3") && at->is_regular_file(none))
      names.push_back(at->path().filename().string());
  }
  std::sort(names.begin(), names.end(), NaturalLess);
  std::vector<fs::path> files;
  files.reserve(names.size());
  for (const std::string& name : names) files.push_back(folder / name);
  return files;
}

std::unique_ptr<Bag> Bag::Open(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return OpenBagFile(path);
  const std::vector<fs::path> files = Files(path);
  if (files.empty()) throw InputError(path.string() + ": holds no files of 'ros2 bag record' (.mcap, .db3)");
  if (std::all_of(files.begin(), files.end(), [](const fs::path& f) { return f.extension() == ".zstd"; }))
    throw InputError(path.string() +
                     ": its files are packed as a whole (compression_mode: file); unpack them: " +
                     "zstd -d " + (path / "*.zstd").string());
  if (files.size() == 1) return OpenBagFile(files.front());
  return std::make_unique<PartedBag>(path, files);
}

const Bag::Topic* Bag::Find(const std::string& topic) const {
  const auto at =
      std::find_if(topics_.begin(), topics_.end(), [&](const Topic& t) { return t.name == topic; });
  return at != topics_.end() ? &*at : nullptr;
}

std::vector<BagMessage> Bag::Messages(const std::string& topic) const {
  std::vector<BagMessage> found;
  for (const BagMessage& message : messages_) {
    const auto at = connections_.find(message.connection);
    if (at != connections_.end() && at->second.name == topic) found.push_back(message);
  }
  std::stable_sort(found.begin(), found.end(), [](const BagMessage& a, const BagMessage& b) {
    return std::tie(a.part, a.received_s) < std::tie(b.part, b.received_s);
  });
  return found;
}

std::string Bag::Read(const BagMessage& message) const {
  std::string bytes = ReadStored(message);
  if (!IsPacked(bytes)) return bytes;
  // Its numbers for errors, and for sizes that a frame does not say, are beyond any size.
  const unsigned long long size = ZSTD_getFrameContentSize(bytes.data(), bytes.size());
  std::optional<std::string> unpacked;
  if (size <= kMostMessageBytes) unpacked = Unpacked(Packing::kZstd, bytes, size);
  if (!unpacked) throw InputError("a message can't be unpacked: it is damaged");
  return *std::move(unpacked);
}

std::size_t Bag::Lost(const std::string& topic) const {
  std::size_t lost = 0;
  for (const auto& [connection, count] : lost_) {
    const auto at = connections_.find(connection);
    if (at != connections_.end() && at->second.name == topic) lost += count;
  }
  return lost;
}

void Bag::AddMessage(const BagMessage& message) {
  if (messages_.size() == kMostBagMessages)
    throw InputError(file_.string() + ": has more than " + std::to_string(kMostBagMessages / 1'000'000) +
                     " million messages; take the images out with 'rosbag filter' or 'ros2 bag convert'");
  messages_.push_back(message);
}

void Bag::NoteDamage(const std::string& text) {
  if (damage_.empty()) damage_ = file_.string() + ": " + text;
}

void Bag::Absorb(Bag&& part, std::uint32_t number) {
  std::map<std::uint32_t, std::uint32_t> ids;
  for (auto& [id, topic] : part.connections_) {
    const auto here = static_cast<std::uint32_t>(connections_.size());
    ids[id] = here;
    connections_.emplace(here, std::move(topic));
  }
  for (BagMessage message : std::exchange(part.messages_, {})) {
    const auto at = ids.find(message.connection);
    if (at == ids.end()) continue;
    message.connection = at->second;
    message.part = number;
    AddMessage(message);
  }
  for (const auto& [id, count] : part.lost_) {
    if (const auto at = ids.find(id); at != ids.end()) lost_[at->second] += count;
  }
  if (damage_.empty()) damage_ = part.damage_;
}

void Bag::ListTopics() {
  topics_.clear();
  for (const auto& [id, topic] : connections_) topics_.push_back(topic);
  std::stable_sort(topics_.begin(), topics_.end(),
                   [](const Topic& a, const Topic& b) { return a.name < b.name; });
  topics_.erase(std::unique(topics_.begin(), topics_.end(),
                            [](const Topic& a, const Topic& b) { return a.name == b.name; }),
                topics_.end());
}

}  // namespace tutti
