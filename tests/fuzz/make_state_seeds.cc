// Seeds for detector_state_fuzzer: tutti_make_state_seeds FOLDER saves small detectors there, in its format.
#include <cctype>
#include <filesystem>
#include <fstream>
#include <stdexcept>

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

std::string Unwrap(const std::string& file, int kind) {
  if (file.substr(0, tutti::fuzz::kHeader.size()) != tutti::fuzz::kHeader) {
    throw std::logic_error("kHeader is not that of a saved detector: every input would be refused at once");
  }
  tutti::internal::ByteReader in(std::string_view(file).substr(tutti::fuzz::kHeader.size()), "seed");
  std::string seed(1, static_cast<char>(kind));
  while (!in.AtEnd()) {
    const auto tag = in.Get<std::uint32_t>();
    in.Get<std::uint32_t>();  // checksum
    const std::string content = ShortenGenerators(in.GetString());
    if (tag == tutti::fuzz::kEndTag) break;
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
      std::ifstream in(saved, std::ios::binary);
      const std::string file((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
      std::filesystem::remove(saved);
      std::ofstream(folder / (std::to_string(kind) + "_" + std::to_string(images)), std::ios::binary)
          << Unwrap(file, kind);
      detector.Detect(
          tutti::fuzz::StateQuery(images, static_cast<std::uint32_t>(images % 5), images % 3 != 2));
    }
  }
  return 0;
}
