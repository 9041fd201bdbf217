#include "loopclosure/store/section_file.h"

#include <gtest/gtest.h>

#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

namespace fs = std::filesystem;

std::string Content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return std::string((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
}

class SectionFile : public ::testing::Test {
 protected:
  void WriteTwoSections() const {
    SectionWriter out(file_);
    out.Write(Section::kOptions, "first");
    out.Write(Section::kView, std::string("a\0b", 3));
    out.Finish();
  }
  // The message that reading bytes to their end fails with.
  std::string Refusal(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary) << bytes;
    try {
      SectionReader in(file_);
      Section section = Section::kOptions;
      while (section != Section::kEnd) in.Next(section);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  fs::path file_ = tutti::testing::FreshFolder() / "sections";
};

TEST_F(SectionFile, SectionsComeBackInTheirOrder) {
  WriteTwoSections();
  SectionReader in(file_);
  EXPECT_EQ(in.Expect(Section::kOptions), "first");
  Section section = Section::kEnd;
  EXPECT_EQ(in.Next(section), std::string("a\0b", 3));
  EXPECT_EQ(section, Section::kView);
  EXPECT_EQ(in.Expect(Section::kEnd), "");
  EXPECT_THROW(in.Next(section), InputError);
}

TEST_F(SectionFile, AnotherSectionThanTheExpectedOneIsDamage) {
  WriteTwoSections();
  SectionReader in(file_);
  EXPECT_THROW(in.Expect(Section::kMember), InputError);
}

TEST_F(SectionFile, WithoutFinishNothingIsLeftAndTheOldFileStays) {
  WriteTwoSections();
  const std::string before = Content(file_);
  {
    SectionWriter out(file_);
    out.Write(Section::kOptions, "new");
  }
  EXPECT_EQ(Content(file_), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(file_.parent_path()), fs::directory_iterator()), 1);
  EXPECT_THROW(SectionWriter(file_ / "no" / "folder"), InputError);
}

TEST_F(SectionFile, CutOffOrChangedAnywhereItIsRefused) {
  WriteTwoSections();
  const std::string bytes = Content(file_);
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
  std::string bytes = Content(file_);
  bytes[16 + 8 + 7] = 0x7f;  // the first section's length, highest byte
  EXPECT_NE(Refusal(bytes).find("ends too early"), std::string::npos);
}

TEST_F(SectionFile, NoFileAnotherKindAndAnotherVersionAreSaid) {
  EXPECT_THROW(SectionReader(file_ / "absent"), InputError);
  EXPECT_THROW(SectionReader(file_.parent_path()), InputError);
  EXPECT_NE(Refusal("this is no detector at all").find("is no saved loop detector"), std::string::npos);
  WriteTwoSections();
  const std::string bytes = Content(file_);
  std::string newer = bytes;
  newer[8] = 9;
  EXPECT_NE(Refusal(newer).find("version 9"), std::string::npos);
  std::string other_order = bytes;
  std::swap(other_order[12], other_order[15]);
  EXPECT_NE(Refusal(other_order).find("another byte order"), std::string::npos);
}

}  // namespace
}  // namespace tutti::internal
