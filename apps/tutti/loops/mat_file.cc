#include "apps/tutti/loops/mat_file.h"

#include <matio.h>

#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "core/text_reader.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

constexpr std::size_t kMaxRows = 20000;  // more is surely a damaged file
constexpr std::uintmax_t kMostBytes = 2'000'000'000;
constexpr std::size_t kMostPacked = 1100;  // numbers of a byte each that zlib puts into one

struct CloseFile {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using MatFile = std::unique_ptr<mat_t, CloseFile>;
using Variable = std::unique_ptr<matvar_t, FreeVariable>;

template <typename T>
std::vector<double> Copied(const void* data, std::size_t count) {
  std::vector<T> values(count);
  if (count > 0) std::memcpy(values.data(), data, count * sizeof(T));
  return std::vector<double>(values.begin(), values.end());
}

// So many numbers of a variable that was read; empty for what are none.
std::vector<double> NumbersOf(const matvar_t& variable, const void* data, std::size_t count) {
  if (data == nullptr) return {};
  switch (variable.data_type) {
    case MAT_T_INT8:
      return Copied<mat_int8_t>(data, count);
    case MAT_T_UINT8:
      return Copied<mat_uint8_t>(data, count);
    case MAT_T_INT16:
      return Copied<mat_int16_t>(data, count);
    case MAT_T_UINT16:
      return Copied<mat_uint16_t>(data, count);
    case MAT_T_INT32:
      return Copied<mat_int32_t>(data, count);
    case MAT_T_UINT32:
      return Copied<mat_uint32_t>(data, count);
    case MAT_T_INT64:
      return Copied<mat_int64_t>(data, count);
    case MAT_T_UINT64:
      return Copied<mat_uint64_t>(data, count);
    case MAT_T_SINGLE:
      return Copied<float>(data, count);
    case MAT_T_DOUBLE:
      return Copied<double>(data, count);
    default:
      return {};
  }
}

// Row by row; nothing if it can't be read, or its parts do not fit each other: matio gives what the file
// says.
std::optional<std::vector<double>> FromSparse(mat_t* file, matvar_t& variable, std::size_t n) {
  if (Mat_VarReadDataAll(file, &variable) != 0 || variable.data == nullptr) return {};
  const auto& sparse = *static_cast<const mat_sparse_t*>(variable.data);
  const std::vector<double> numbers = NumbersOf(variable, sparse.data, sparse.ndata);
  if (sparse.njc < n + 1 || sparse.jc == nullptr || sparse.ir == nullptr) return {};
  std::vector<double> values(n * n, 0.0);
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t k = sparse.jc[c]; k < sparse.jc[c + 1]; ++k) {
      if (k >= numbers.size() || k >= sparse.nir || sparse.ir[k] >= n) return {};
      values[sparse.ir[k] * n + c] = numbers[k];
    }
  }
  return values;
}

// Likewise. Where the file has fewer numbers than the matrix, matio is silent and leaves the rest as it was:
// what is read over two fillings is the same only if all of it is there.
std::optional<std::vector<double>> FromFull(mat_t* file, matvar_t& variable, std::size_t n) {
  std::array<int, 2> start = {0, 0}, stride = {1, 1}, edge = {static_cast<int>(n), static_cast<int>(n)};
  const std::size_t size = Mat_SizeOfClass(variable.class_type);
  std::vector<char> bytes(n * n * size, '\0'), again(bytes.size(), '\x7f');
  for (std::vector<char>* into : {&bytes, &again}) {
    if (Mat_VarReadData(file, &variable, into->data(), start.data(), stride.data(), edge.data()) != 0)
      return {};
  }
  if (bytes != again || Mat_SizeOf(variable.data_type) != size) return {};
  const std::vector<double> columns = NumbersOf(variable, bytes.data(), n * n);
  if (columns.size() != n * n) return {};
  std::vector<double> values(n * n);  // MATLAB keeps a matrix column by column
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t r = 0; r < n; ++r) values[r * n + c] = columns[c * n + r];
  }
  return values;
}

bool IsSquareMatrix(const matvar_t& variable) {
  const bool real =
      variable.class_type >= MAT_C_SPARSE && variable.class_type <= MAT_C_UINT64 && variable.isComplex == 0;
  return real && variable.rank == 2 && variable.dims != nullptr && variable.dims[0] == variable.dims[1] &&
         variable.dims[0] > 1;
}

enum class Container { kWhole, kCutOff, kOther };

// matio takes a file that is cut off for a whole one, crashes on parts of some compressed ones, and has HDF5
// print what is wrong with version 7.3: only whole files of versions 5 to 7 get that far.
Container Examine(const std::string& bytes) {
  constexpr std::size_t kHeader = 128, kTag = 8;
  constexpr std::uint32_t kCompressed = 15;  // the only element without padding
  if (bytes.rfind("MATLAB 5.0", 0) != 0) return Container::kOther;
  if (bytes.size() < kHeader + kTag) return Container::kCutOff;
  if (bytes.compare(126, 2, "IM") != 0) return Container::kOther;  // of a big-endian machine
  for (std::size_t at = kHeader; at + kTag <= bytes.size();) {
    std::array<std::uint32_t, 2> tag = {0, 0};  // type and length
    std::memcpy(tag.data(), bytes.data() + at, kTag);
    if (tag[1] > bytes.size() - at - kTag) return Container::kCutOff;
    at += kTag + tag[1] + (tag[0] == kCompressed ? 0 : (8 - tag[1] % 8) % 8);
  }
  return Container::kWhole;
}

}  // namespace

bool IsMatFile(const std::filesystem::path& file) {
  std::string type = file.extension().string();
  for (char& c : type) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  std::string head(6, '\0');
  std::ifstream(file, std::ios::binary).read(head.data(), static_cast<std::streamsize>(head.size()));
  return type == ".mat" || head == "MATLAB";
}

LoopGroundTruth ReadMatLoops(const std::filesystem::path& path) {
  const auto fail = [&path](const std::string& what) { throw InputError(path.string() + ": " + what); };
  internal::RequireFile(path, "check the path of the ground truth");
  std::ifstream in(path, std::ios::binary);
  if (!in) fail("can't be opened; check the path of the ground truth");
  std::error_code error;
  if (std::filesystem::file_size(path, error) > kMostBytes || error)
    fail("is larger than " + std::to_string(kMostBytes / 1000000) + " MB; save the loop matrix alone");
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const Container container = Examine(bytes);
  if (container == Container::kOther) fail("is no file of MATLAB 5 to 7; save it with -v6 or -v7");
  if (container == Container::kCutOff) fail("damaged MATLAB file (it is cut off); copy it again");
  Mat_LogInitFunc("tutti", [](int, char*) {});  // what is wrong is said here, once
  const MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) fail("damaged MATLAB file; copy it again");
  while (const Variable variable{Mat_VarReadNextInfo(file.get())}) {
    if (!IsSquareMatrix(*variable)) continue;
    const std::size_t n = variable->dims[0];
    const bool sparse = variable->class_type == MAT_C_SPARSE;
    if (n > kMaxRows || (!sparse && n * n > kMostPacked * bytes.size())) {
      fail("damaged MATLAB file (a matrix of " + std::to_string(n) + " rows); copy it again");
    }
    const auto values = sparse ? FromSparse(file.get(), *variable, n) : FromFull(file.get(), *variable, n);
    if (!values) fail("damaged MATLAB file (its matrix can't be read); copy it again");
    LoopGroundTruth truth = LoopsFromMatrix(*values, static_cast<int>(n));
    truth.description = path.string();
    return truth;
  }
  fail("holds no square matrix of numbers, which ground truth of loops is; save one, or copy the file again");
  return {};
}

}  // namespace tutti::cli
