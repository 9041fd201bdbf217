#include "apps/tutti/loops/mat_file.h"

#include <matio.h>

#include <cctype>
#include <cstddef>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

constexpr std::size_t kMaxRows = 20000;  // more is surely a damaged file

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
  const T* values = static_cast<const T*>(data);
  return std::vector<double>(values, values + count);
}

// The real parts of so many numbers; empty for what are none.
std::vector<double> Numbers(const matvar_t& variable, const void* data, std::size_t count) {
  if (variable.isComplex != 0 && data != nullptr) data = static_cast<const mat_complex_split_t*>(data)->Re;
  if (data == nullptr || static_cast<std::size_t>(variable.data_size) != Mat_SizeOf(variable.data_type)) {
    return {};
  }
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

// Row by row; nothing if its parts do not fit each other. matio gives what the file says, unchecked.
std::optional<std::vector<double>> FromSparse(const matvar_t& variable, std::size_t n) {
  const auto& sparse = *static_cast<const mat_sparse_t*>(variable.data);
  const std::vector<double> numbers = Numbers(variable, sparse.data, sparse.ndata);
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

// MATLAB keeps a matrix column by column.
std::optional<std::vector<double>> FromFull(const matvar_t& variable, std::size_t n) {
  if (variable.nbytes < n * n * Mat_SizeOf(variable.data_type)) return {};
  const std::vector<double> columns = Numbers(variable, variable.data, n * n);
  if (columns.size() != n * n) return {};
  std::vector<double> values(n * n);
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t r = 0; r < n; ++r) values[r * n + c] = columns[c * n + r];
  }
  return values;
}

bool IsSquareMatrix(const matvar_t& variable) {
  const bool numeric = variable.class_type >= MAT_C_SPARSE && variable.class_type <= MAT_C_UINT64;
  return numeric && variable.rank == 2 && variable.dims != nullptr && variable.dims[0] == variable.dims[1] &&
         variable.dims[0] > 1;
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
  Mat_LogInitFunc("tutti", [](int, char*) {});  // what is wrong is said here, once
  const auto fail = [&path](const std::string& what) { throw InputError(path.string() + ": " + what); };
  const MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) fail("is no MATLAB file, or damaged; copy it again, or save it with -v6, -v7 or -v7.3");
  while (const Variable variable{Mat_VarReadNextInfo(file.get())}) {
    if (!IsSquareMatrix(*variable)) continue;
    const std::size_t n = variable->dims[0];
    if (n > kMaxRows) fail("damaged MATLAB file (a matrix of " + std::to_string(n) + " rows); copy it again");
    std::optional<std::vector<double>> values;
    if (Mat_VarReadDataAll(file.get(), variable.get()) == MATIO_E_NO_ERROR && variable->data != nullptr) {
      values = variable->class_type == MAT_C_SPARSE ? FromSparse(*variable, n) : FromFull(*variable, n);
    }
    if (!values) fail("damaged MATLAB file (its matrix can't be read); copy it again");
    LoopGroundTruth truth = LoopsFromMatrix(*values, static_cast<int>(n));
    truth.description = path.string();
    return truth;
  }
  fail("holds no square matrix of numbers, which ground truth of loops is; save one, or copy the file again");
  return {};
}

}  // namespace tutti::cli
