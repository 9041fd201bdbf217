#include "core/section_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <string>
#include <string_view>

#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;

constexpr SectionFileKind kKind = {{'T', 'E', 'S', 'T', 'F', 'I', 'L', 'E'}, 3, "test file", "a test"};
enum class Section : std::uint32_t { kFirst = 1, kSecond = 2, kThird = 3 };

class SectionFile : public ::testing::Test {
 protected:
  void WriteTwoSections() const {
    SectionWriter out(file_, kKind);
    out.Write(Section::kFirst, "first");
    out.Write(Section::kSecond, std::string("a\0b", 3));
    out.Finish();
  }
  // The message that reading bytes to their end fails with.
  std::string Refusal(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary) << bytes;
    const std::string error = tutti::testing::ErrorOf([this] {
      SectionReader in(file_, kKind);
      in.Expect(Section::kFirst);
      in.Expect(Section::kSecond);
      in.Expect(kEndOfSections);
    });
    return error == "no error" ? "" : error;
  }
  fs::path file_ = tutti::testing::FreshFolder() / "sections";
};

TEST_F(SectionFile, BytesBehindTheEndAreRefused) {
  WriteTwoSections();
  const std::string bytes = tutti::testing::BytesOf(file_);
  EXPECT_EQ(Refusal(bytes), "");
  for (const std::string& more : {std::string("x"), std::string(100, '\0'), bytes})
    EXPECT_NE(Refusal(bytes + more).find("bytes behind its end"), std::string::npos);
}

TEST_F(SectionFile, SectionsComeBackInTheirOrder) {
  WriteTwoSections();
  SectionReader in(file_, kKind);
  EXPECT_EQ(in.Expect(Section::kFirst), "first");
  EXPECT_EQ(in.Peek(), 2u);
  std::string bytes;
  EXPECT_EQ(in.Next(&bytes), 2u);
  EXPECT_EQ(bytes, std::string("a\0b", 3));
  EXPECT_EQ(in.Expect(kEndOfSections), "");
  EXPECT_THROW(in.Next(&bytes), InputError);
  EXPECT_THROW(SectionReader(file_, kKind).Expect(Section::kThird), InputError) << "another than expected";
}

TEST_F(SectionFile, WhatStandsBeforeASectionCanBeLeftOut) {
  WriteTwoSections();
  SectionReader in(file_, kKind);
  in.SkipTo(Section::kSecond);
  in.SkipTo(Section::kSecond);
  EXPECT_EQ(in.Expect(Section::kSecond), std::string("a\0b", 3));
  EXPECT_THROW(in.SkipTo(Section::kFirst), InputError);
}

TEST_F(SectionFile, WithoutFinishNothingIsLeftAndTheOldFileStays) {
  WriteTwoSections();
  const std::string before = tutti::testing::BytesOf(file_);
  {
    SectionWriter out(file_, kKind);
    out.Write(Section::kFirst, "new");
  }
  EXPECT_EQ(tutti::testing::BytesOf(file_), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(file_.parent_path()), fs::directory_iterator()), 1);
  EXPECT_THROW(SectionWriter(file_ / "no" / "folder", kKind), InputError);
}

TEST_F(SectionFile, CutOffOrChangedAnywhereItIsRefused) {
  WriteTwoSections();
  const std::string bytes = tutti::testing::BytesOf(file_);
  EXPECT_EQ(Refusal(bytes), "");
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    EXPECT_NE(Refusal(bytes.substr(0, at)).find(file_.string()), std::string::npos) << at;
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 0x80);
    EXPECT_NE(Refusal(changed).find(file_.string()), std::string::npos) << at;
  }
}

TEST_F(SectionFile, ALengthThatNoFileHasIsRefusedWithoutReservingIt) {
  WriteTwoSections();
  std::string bytes = tutti::testing::BytesOf(file_);
  bytes[16 + 16 + 7] = 0x7f;  // how much is stored of the first section, highest byte
  EXPECT_NE(Refusal(bytes).find("ends too early"), std::string::npos);
  bytes[16 + 16 + 7] = 0;
  EXPECT_EQ(Refusal(bytes), "");
  bytes[16 + 8 + 7] = 0x7f;  // its length
  EXPECT_NE(Refusal(bytes).find("impossible size"), std::string::npos);
}

// Bytes that no code makes fewer.
std::string Noise(std::size_t size, unsigned seed) {
  std::mt19937 generator(seed);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(generator());
  return bytes;
}

TEST_F(SectionFile, WhatRepeatsIsStoredOnceAndComesBack) {
  const std::string noise = Noise(100000, 1), other = Noise(20000, 2), even(300000, 'x');
  std::string few;
  for (int i = 0; i < 100000; ++i) few += static_cast<char>(i % 5 * i % 5);
  {
    SectionWriter out(file_, kKind);
    const std::uint64_t place = out.Write(Section::kFirst, noise);
    out.Write(Section::kSecond, other + noise + other, place);
    out.Write(Section::kThird, noise, place);  // once only: stored in full
    out.Write(Section::kFirst, few);
    out.Write(Section::kSecond, even);
    out.Finish();
  }
  EXPECT_LT(fs::file_size(file_), 2 * noise.size() + 2 * other.size() + few.size() / 8 + even.size() / 15);
  SectionReader in(file_, kKind);
  EXPECT_TRUE(in.Expect(Section::kFirst) == noise);
  EXPECT_EQ(in.Peek(), 2u);
  EXPECT_TRUE(in.Expect(Section::kSecond) == other + noise + other);
  EXPECT_TRUE(in.Expect(Section::kThird) == noise);
  EXPECT_TRUE(in.Expect(Section::kFirst) == few);
  EXPECT_TRUE(in.Expect(Section::kSecond) == even);
  EXPECT_EQ(in.Expect(kEndOfSections), "");
}

// Headers that say what is not so, under right checksums.
TEST_F(SectionFile, AHostileHeaderIsRefused) {
  const std::string noise = Noise(1000, 1), other = Noise(200, 2);
  std::uint64_t place = 0;
  {
    SectionWriter out(file_, kKind);
    place = out.Write(Section::kFirst, noise);
    out.Write(Section::kSecond, noise + other, place);
    out.Finish();
  }
  const std::string bytes = tutti::testing::BytesOf(file_);
  EXPECT_EQ(Refusal(bytes), "");
  const std::size_t second = place + sizeof(SectionHeader) + noise.size();
  const auto refusal = [&](const auto& change) {
    SectionHeader header;
    std::memcpy(&header, bytes.data() + second, sizeof header);
    EXPECT_EQ(header.like, place);
    change(&header);
    header.checksum = SectionChecksum(
        header,
        std::string_view(bytes).substr(second + sizeof header, static_cast<std::size_t>(header.stored)));
    std::string changed = bytes;
    std::memcpy(changed.data() + second, &header, sizeof header);
    return Refusal(changed);
  };
  const auto impossible = [](const std::string& text) {
    return text.find("impossible size") != std::string::npos;
  };
  EXPECT_TRUE(impossible(refusal([](SectionHeader* h) { h->size = h->stored * 17 + 17; })));
  EXPECT_TRUE(impossible(refusal([](SectionHeader* h) { h->size = ~std::uint64_t{0}; })));
  EXPECT_TRUE(impossible(refusal([](SectionHeader* h) { h->size = h->stored - 1; })));
  EXPECT_NE(refusal([](SectionHeader* h) { h->size = h->stored * 2; }).find("unpacked"), std::string::npos);
  EXPECT_NE(refusal([](SectionHeader* h) { h->like = 0; }).find("unpacked"), std::string::npos);
  for (const std::uint64_t like : {std::uint64_t{second}, std::uint64_t{1} << 60, ~std::uint64_t{0}})
    EXPECT_NE(refusal([&](SectionHeader* h) { h->like = like; }).find("nowhere"), std::string::npos) << like;
  EXPECT_NE(refusal([](SectionHeader* h) { h->like = 3; }), "");
}

TEST_F(SectionFile, TwoWritersOfOneFileNeverSpoilEachOther) {
  SectionWriter one(file_, kKind), other(file_, kKind);
  const auto write = [](const std::string& what, SectionWriter* out) {
    for (const Section section : {Section::kFirst, Section::kSecond}) out->Write(section, what);
    out->Finish();
  };
  one.Write(Section::kThird, "unfinished");
  write("other", &other);
  SectionReader in(file_, kKind);
  EXPECT_EQ(in.Expect(Section::kFirst), "other");
  EXPECT_EQ(in.Expect(Section::kSecond), "other");
}

TEST_F(SectionFile, WhatAKilledWriterLeftIsRemoved) {
  const fs::path folder = file_.parent_path();
  const fs::path left = folder / ".sections.part-999999999-0";  // no process has this number
  const fs::path busy = folder / ".sections.part-1-0";
  std::ofstream(left) << "half";
  std::ofstream(busy) << "half";
  WriteTwoSections();
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(busy));
}

TEST_F(SectionFile, NoFileAnotherKindAndAnotherVersionAreSaid) {
  EXPECT_THROW(SectionReader(file_ / "absent", kKind), InputError);
  EXPECT_THROW(SectionReader(file_.parent_path(), kKind), InputError);
  EXPECT_NE(Refusal("this is no such file at all").find("is no test file"), std::string::npos);
  WriteTwoSections();
  const std::string bytes = tutti::testing::BytesOf(file_);
  std::string newer = bytes;
  newer[8] = 9;
  EXPECT_NE(Refusal(newer).find("version 9"), std::string::npos);
  std::string other_order = bytes;
  std::swap(other_order[12], other_order[15]);
  EXPECT_NE(Refusal(other_order).find("another byte order"), std::string::npos);
}

}  // namespace
}  // namespace tutti::internal
