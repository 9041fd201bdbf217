#include "apps/tutti/loops/mat_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

#include "tests/apps/tutti/mat_bytes.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;
using tutti::testing::kBytes;
using tutti::testing::kCell;
using tutti::testing::kDouble;
using tutti::testing::kDoubles;
using tutti::testing::kInt32;
using tutti::testing::kSparse;
using tutti::testing::kUint8;
using tutti::testing::MatElement;
using tutti::testing::MatHeader;
using tutti::testing::MatVariable;

std::string SparseVariable(int n, const std::vector<std::int32_t>& rows,
                           const std::vector<std::int32_t>& starts, const std::vector<double>& numbers) {
  return MatVariable(kSparse, n, n,
                     MatElement(kInt32, rows) + MatElement(kInt32, starts) + MatElement(kDouble, numbers));
}

class MatFile : public ::testing::Test {
 protected:
  fs::path Write(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary) << bytes;
    return file_;
  }
  fs::path WriteVariables(const std::string& variables) const { return Write(MatHeader() + variables); }
  std::string Problem(const fs::path& file) const {
    try {
      ReadMatLoops(file);
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).rfind(file.string() + ": ", 0), 0u) << error.what();
      return error.what();
    }
    return "";
  }
  fs::path file_ = tutti::testing::FreshFolder() / "t.mat";
};

TEST_F(MatFile, ValuesAreColumnMajor) {
  const std::vector<double> lower = {0, 0, 0.5, 0, 0, 1, 0, 0, 0};
  const LoopGroundTruth truth =
      ReadMatLoops(WriteVariables(MatVariable(kDoubles, 3, 3, MatElement(kDouble, lower))));
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kLoop);
  EXPECT_EQ(truth.description, file_.string());
  const std::vector<double> upper = {0, 0, 0, 0, 0, 0, 0.5, 1, 0};
  const LoopGroundTruth transposed =
      ReadMatLoops(WriteVariables(MatVariable(kDoubles, 3, 3, MatElement(kDouble, upper))));
  EXPECT_EQ(transposed.At(2, 0), LoopLabel::kIgnore);
  EXPECT_EQ(transposed.At(2, 1), LoopLabel::kLoop);
}

TEST_F(MatFile, BytesAndDoublesThatAreKeptInBytesAreNumbersToo) {
  for (const std::uint32_t array_class : {kBytes, kDoubles}) {
    const std::vector<std::uint8_t> loop = {0, 1, 0, 0};
    const LoopGroundTruth truth =
        ReadMatLoops(WriteVariables(MatVariable(array_class, 2, 2, MatElement(kUint8, loop))));
    EXPECT_EQ(truth.At(1, 0), LoopLabel::kLoop) << array_class;
  }
}

TEST_F(MatFile, SparseMatricesAreRead) {
  const LoopGroundTruth truth = ReadMatLoops(WriteVariables(SparseVariable(3, {1, 2}, {0, 2, 2, 2}, {1, 7})));
  EXPECT_EQ(truth.size(), 3);
  EXPECT_EQ(truth.At(1, 0), LoopLabel::kLoop);
  EXPECT_EQ(truth.At(2, 0), LoopLabel::kIgnore);
  EXPECT_EQ(truth.At(2, 1), LoopLabel::kNone);
}

TEST_F(MatFile, SparseMatricesWhosePartsDoNotFitAreDamaged) {
  for (const std::string& variable :
       {SparseVariable(3, {1, 3}, {0, 2, 2, 2}, {1, 1}), SparseVariable(3, {1, -1}, {0, 2, 2, 2}, {1, 1}),
        SparseVariable(3, {1, 2}, {0, 9, 9, 9}, {1, 1}), SparseVariable(3, {1, 2}, {0, -1, 2, 2}, {1, 1}),
        SparseVariable(3, {1, 2}, {0, 2}, {1, 1}), SparseVariable(3, {1, 2}, {0, 2, 2, 2}, {1})}) {
    EXPECT_NE(Problem(WriteVariables(variable)).find("damaged MATLAB file"), std::string::npos);
  }
}

TEST_F(MatFile, TheFirstSquareMatrixOfNumbersIsTaken) {
  const std::string line = MatVariable(kDoubles, 3, 2, MatElement<double>(kDouble, {0, 0, 0, 0, 0, 0}));
  const std::string one = MatVariable(kDoubles, 1, 1, MatElement<double>(kDouble, {1}));
  const std::string cells = MatVariable(kCell, 0, 0, "");
  const std::string matrix = MatVariable(kDoubles, 2, 2, MatElement<double>(kDouble, {0, 1, 0, 0}));
  EXPECT_EQ(ReadMatLoops(WriteVariables(line + one + cells + matrix)).RowsWithLoop(), 1);
  EXPECT_NE(Problem(WriteVariables(line + one + cells)).find("no square matrix"), std::string::npos);
  EXPECT_NE(Problem(WriteVariables("")), "");
}

TEST_F(MatFile, WhatIsNoFileOfMatlab5To7IsSaid) {
  const std::string big_endian = "MATLAB 5.0 MAT-file" + std::string(105, ' ') + std::string("\1\0MI", 4);
  for (const std::string& bytes : {std::string(), std::string("0 0 0\n0 0 0\n1 0 0\n"),
                                   big_endian + big_endian, "MATLAB 7.3 MAT-file" + std::string(600, ' ')}) {
    EXPECT_NE(Problem(Write(bytes)).find("is no file of MATLAB 5 to 7; save it with"), std::string::npos);
  }
  EXPECT_NE(Problem("/nowhere/t.mat").find("can't be opened"), std::string::npos);
  EXPECT_NE(Problem(file_.parent_path()).find("is a folder"), std::string::npos);
}

TEST_F(MatFile, AFileThatIsCutOffAnywhereIsRefused) {
  for (const std::string& variable :
       {SparseVariable(3, {1, 2}, {0, 2, 2, 2}, {1, 7}),
        MatVariable(kDoubles, 3, 3, MatElement<double>(kDouble, {0, 0, 0.5, 0, 0, 1, 0, 0, 0}))}) {
    const std::string good = MatHeader() + variable;
    EXPECT_EQ(Problem(Write(good)), "");
    for (std::size_t length = 0; length < good.size(); ++length) {
      EXPECT_NE(Problem(Write(good.substr(0, length))), "") << length;
    }
  }
}

TEST_F(MatFile, FewerNumbersThanTheMatrixHasOrMoreRowsThanTheFileCanAreDamage) {
  const std::string content = MatElement<double>(kDouble, {0, 1, 0, 0});
  EXPECT_NE(Problem(WriteVariables(MatVariable(kDoubles, 30, 30, content))).find("can't be read"),
            std::string::npos);
  for (const int rows : {2000, 20000, 20001, 2000000000}) {  // would take up to 3 GB and more
    EXPECT_NE(Problem(WriteVariables(MatVariable(kDoubles, rows, rows, content))).find("rows"),
              std::string::npos);
  }
}

TEST_F(MatFile, IsKnownByItsNameOrItsBeginning) {
  EXPECT_TRUE(IsMatFile("/nowhere/T.MAT"));
  EXPECT_FALSE(IsMatFile("/nowhere/t.txt"));
  const fs::path other = file_.parent_path() / "truth";
  std::ofstream(other) << "MATLAB 5.0 MAT-file";
  EXPECT_TRUE(IsMatFile(other));
  std::ofstream(other) << "0 0\n1 0\n";
  EXPECT_FALSE(IsMatFile(other));
}

TEST_F(MatFile, PublishedFilesAreRead) {
  TUTTI_REQUIRE_DATA(folder, "loop_gt");
  const LoopGroundTruth indoor = ReadMatLoops(folder / "Lip6IndoorGroundTruth.mat");
  EXPECT_EQ(indoor.size(), 388);
  EXPECT_GT(indoor.RowsWithLoop(), 100);
  EXPECT_EQ(ReadMatLoops(folder / "Lip6OutdoorGroundTruth.mat").size(), 1063);
  EXPECT_EQ(ReadMatLoops(folder / "city_centre_htmap.mat").size(), 1237);
  EXPECT_EQ(ReadMatLoops(folder / "city_GT_final.mat").size(), 1237);
}

// Reads a good file with `times` random changes of up to four bytes, a sixth of them cut off as well. Any
// matrix or an InputError will do; a crash ends the test program.
void ReadDamaged(const fs::path& file, const std::string& good, int times) {
  std::mt19937 random(1);
  const auto below = [&random](std::size_t end) { return static_cast<std::size_t>(random()) % end; };
  for (int i = 0; i < times; ++i) {
    std::string bad = good;
    for (std::size_t k = 0; k <= below(4); ++k) {
      const std::size_t reach = below(2) == 0 ? bad.size() : std::min<std::size_t>(bad.size(), 400);
      bad[below(reach)] = static_cast<char>(random());
    }
    if (below(6) == 0) bad.resize(below(bad.size()));
    std::ofstream(file, std::ios::binary) << bad;
    try {
      ReadMatLoops(file);
    } catch (const InputError&) {
    }
  }
}

TEST_F(MatFile, DamageIsAnErrorAndNothingElse) {
  TUTTI_REQUIRE_DATA(published, "loop_gt/Lip6IndoorGroundTruth.mat");
  std::ifstream in(published, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  for (const std::size_t length : {11u, 100u, 127u, 128u, 135u, 140u, 700u, 1900u}) {
    EXPECT_NE(Problem(Write(good.substr(0, length))), "") << length;
  }
  ReadDamaged(file_, good, 60);
}

TEST_F(MatFile, DamageIsNotPrintedEither) {
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  for (const std::string& variable :
       {SparseVariable(3, {1, 2}, {0, 2, 2, 2}, {1, 7}),
        MatVariable(kDoubles, 3, 3, MatElement<double>(kDouble, {0, 0, 0.5, 0, 0, 1, 0, 0, 0}))}) {
    WriteVariables(variable);
    std::ifstream in(file_, std::ios::binary);
    const std::string good((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    ReadDamaged(file_, good, 30);  // matio takes gigabytes where it is told to
  }
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace tutti::cli
