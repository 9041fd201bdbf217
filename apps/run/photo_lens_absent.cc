// In the place of photo_lens.cc where there is no libexif.
#include <array>
#include <fstream>
#include <string_view>

#include "apps/run/recording.h"

namespace tutti {

// It is the first or second segment of a JPEG file.
bool HasUnreadLens(const std::filesystem::path& file) {
  std::array<char, 64> head{};
  std::error_code code;
  if (!std::filesystem::is_regular_file(file, code)) return false;
  std::ifstream(file, std::ios::binary).read(head.data(), head.size());
  const std::string_view bytes(head.data(), head.size());
  return bytes.substr(0, 2) == "\xFF\xD8" && bytes.find("Exif") != std::string_view::npos;
}

std::optional<PhotoLens> ReadPhotoLens(const std::filesystem::path&, int, int) { return std::nullopt; }

}  // namespace tutti
