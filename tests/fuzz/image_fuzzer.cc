// Image files: any bytes give an image of a bounded size, or say what is wrong. What claims to be large is
// not decoded here, or the decoders' time would be all that is measured.
#include <cstdlib>
#include <vector>

#include "frontend/dataset/image_file.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::uint64_t kMost = 512;  // [px], each side
  const auto claimed = tutti::SizeInHeader(std::vector<unsigned char>(data, data + size));
  if (!claimed || claimed->width > kMost || claimed->height > kMost) return 0;
  const tutti::ImageFile read = tutti::ReadGreyFile(tutti::fuzz::MemoryFile(data, size));
  if (read.image.empty() == read.error.empty()) std::abort();
  return 0;
}
