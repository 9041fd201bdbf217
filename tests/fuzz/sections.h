// Files of sections (saved maps and detectors) for fuzzing, without what random bytes would never get past:
// lengths, checksums, packing, the 6 KB of a random generator's state.
#pragma once

#include <cctype>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "core/byte_stream.h"
#include "core/section_file.h"

namespace tutti::fuzz {

constexpr std::string_view kGeneratorMark = "<RNG>";

/// Appends a section as it stands in a file.
inline void PutSection(std::uint32_t tag, const std::string& content, internal::ByteWriter& file) {
  internal::SectionHeader header = {tag, 0, content.size(), content.size(), 0};
  header.checksum = internal::SectionChecksum(header, content);
  file.Put(header);
  file.PutRaw(content.data(), content.size());
}

/// Appends sections of one byte tag, three bytes size, content; a last one that is cut off counts with what
/// is there.
inline void PutSections(std::string_view sections, internal::ByteWriter& file) {
  constexpr std::size_t kHead = 4;
  static const std::string generator = [] {
    std::ostringstream text;
    text << std::mt19937_64(1);
    internal::ByteWriter out;
    out.PutString(text.str());
    return out.bytes();
  }();
  while (sections.size() >= kHead) {
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(sections[i]); };
    const std::uint32_t tag = byte(0);
    std::string content(sections.substr(kHead, byte(1) + 256u * byte(2) + 65536u * byte(3)));
    sections.remove_prefix(kHead + content.size());
    for (std::size_t at = content.find(kGeneratorMark); at != std::string::npos;
         at = content.find(kGeneratorMark, at + generator.size())) {
      content.replace(at, kGeneratorMark.size(), generator);
    }
    PutSection(tag, content, file);
  }
}

/// A file of what PutSections takes, and of an empty section of each of `ends`.
inline std::string FileOf(const internal::SectionFileKind& kind, std::string_view sections,
                          std::initializer_list<std::uint32_t> ends) {
  internal::ByteWriter file;
  file.PutRaw(kind.magic, sizeof kind.magic);
  file.Put(kind.version);
  file.Put(std::uint32_t{0x01020304});  // the order of bytes
  PutSections(sections, file);
  for (const std::uint32_t end : ends) PutSection(end, "", file);
  return file.Take();
}

// A random generator's state is a string of some thousand digits, after its length.
inline std::string ShortenGenerators(std::string content) {
  constexpr std::size_t kLeast = 3000;
  std::size_t begin = 0;
  while (begin < content.size()) {
    std::size_t end = begin;
    while (end < content.size() &&
           (std::isdigit(static_cast<unsigned char>(content[end])) != 0 || content[end] == ' '))
      ++end;
    if (end - begin >= kLeast) {
      const std::size_t with_length = begin - sizeof(std::uint64_t);
      content.replace(with_length, end - with_length, kGeneratorMark);
      end = with_length + kGeneratorMark.size();
    }
    begin = end + 1;
  }
  return content;
}

/// What PutSections makes the file of, up to the section `end`.
inline std::string SectionsOf(const std::filesystem::path& file, const internal::SectionFileKind& kind,
                              std::uint32_t end) {
  internal::SectionReader in(file, kind);
  std::string sections, content;
  for (std::uint32_t tag = in.Next(&content); tag != end; tag = in.Next(&content)) {
    content = ShortenGenerators(std::move(content));
    if (tag > 255 || content.size() >> 24 != 0) throw std::logic_error("a section that has no seed");
    for (const std::size_t byte :
         {std::size_t{tag}, content.size(), content.size() >> 8, content.size() >> 16})
      sections += static_cast<char>(byte & 255u);
    sections += content;
  }
  return sections;
}

}  // namespace tutti::fuzz
