// Seeds for detector_state_fuzzer: tutti_make_state_seeds FOLDER saves small detectors there, in its format.
#include <cctype>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "loopclosure/detector/detector_file.h"
#include "tests/fuzz/detector_state.h"

namespace {

// A random generator's state is a string of some thousand digits, after its length.
std::string ShortenGenerators(std::string content) {
  constexpr std::size_t kLeast = 3000;
  std::size_t begin = 0;
  while (begin < content.size()) {
    std::size_t end = begin;
    while (end < content.size() &&
           (std::isdigit(static_cast<unsigned char>(content[end])) != 0 || content[end] == ' '))
      ++end;
    if (end - begin >= kLeast) {
      const std::size_t with_length = begin - sizeof(std::uint64_t);
      content.replace(with_length, end - with_length, tutti::fuzz::kGeneratorMark);
      end = with_length + tutti::fuzz::kGeneratorMark.size();
    }
    begin = end + 1;
  }
  return content;
}

std::string Unwrap(const std::filesystem::path& file, int kind) {
  std::string start(tutti::fuzz::kHeader.size(), '\0');
  std::ifstream(file, std::ios::binary).read(start.data(), static_cast<std::streamsize>(start.size()));
  if (start != tutti::fuzz::kHeader) {
    throw std::logic_error("kHeader is not that of a saved detector: every input would be refused at once");
  }
  tutti::internal::SectionReader in(file, tutti::internal::kDetectorFile);
  std::string seed(1, static_cast<char>(kind));
  std::string content;
  for (std::uint32_t tag = in.Next(&content); tag != tutti::fuzz::kEndTag; tag = in.Next(&content)) {
    content = ShortenGenerators(std::move(content));
    for (const std::size_t byte : {std::size_t{tag}, content.size() & 255u, content.size() >> 8})
      seed += static_cast<char>(byte);
    seed += content;
  }
  return seed;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 1;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  for (int kind = 0; kind < tutti::fuzz::kKinds; ++kind) {
    tutti::LoopDetector detector(tutti::fuzz::StateOptions(kind));
    for (int images = 0; images <= 7; ++images) {
      const std::filesystem::path saved = folder / "saved";
      detector.Save(saved);
      std::ofstream(folder / (std::to_string(kind) + "_" + std::to_string(images)), std::ios::binary)
          << Unwrap(saved, kind);
      std::filesystem::remove(saved);
      detector.Detect(
          tutti::fuzz::StateQuery(images, static_cast<std::uint32_t>(images % 5), images % 3 != 2));
    }
  }
  return 0;
}
