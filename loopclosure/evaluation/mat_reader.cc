// MATLAB v5 files ("MAT-File Format", The MathWorks): the part that loop matrices use. Every length is
// checked against what is there, so that a damaged file is an error and nothing else.
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>

#include "tutti/core/error.h"
#include "tutti/loopclosure/ground_truth.h"

namespace tutti {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kMatrix = 14;
constexpr std::uint32_t kCompressed = 15;
constexpr std::uint32_t kSparseClass = 5;
constexpr std::size_t kHeader = 128;
constexpr std::size_t kMaxBytes = std::size_t{1} << 30;  // of an unpacked variable
constexpr int kMaxSize = 20000;

struct Element {
  std::uint32_t type = 0;
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
};

class Reader {
 public:
  Reader(const std::uint8_t* data, std::size_t size, std::string file)
      : data_(data), size_(size), file_(std::move(file)) {}

  bool AtEnd() const { return position_ + 8 > size_; }

  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(file_ + ": damaged MATLAB file (" + what + "); copy it again");
  }

  Element Next() {
    if (AtEnd()) Fail("it ends too early");
    std::uint32_t tag[2];
    std::memcpy(tag, data_ + position_, sizeof tag);
    Element element;
    if (tag[0] >> 16 != 0) {  // small element: size and type share a word, the data follow in the next
      element.type = tag[0] & 0xffffu;
      element.size = tag[0] >> 16;
      if (element.size > 4) Fail("a small element of more than 4 bytes");
      element.data = data_ + position_ + 4;
      position_ += 8;
      return element;
    }
    element.type = tag[0];
    element.size = tag[1];
    element.data = data_ + position_ + 8;
    if (element.size > size_ - position_ - 8) Fail("an element is longer than the file");
    const std::size_t padding = element.type == kCompressed ? 0 : (8 - element.size % 8) % 8;
    position_ = std::min(size_, position_ + 8 + element.size + padding);
    return element;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t position_ = 0;
  std::string file_;
};

template <typename T>
void Append(const Element& element, std::vector<double>& values) {
  for (std::size_t i = 0; i + sizeof(T) <= element.size; i += sizeof(T)) {
    T value;
    std::memcpy(&value, element.data + i, sizeof value);
    values.push_back(static_cast<double>(value));
  }
}

std::vector<double> Numbers(const Element& element, const Reader& reader) {
  std::vector<double> values;
  switch (element.type) {
    case 1:
      Append<std::int8_t>(element, values);
      break;
    case 2:
      Append<std::uint8_t>(element, values);
      break;
    case 3:
      Append<std::int16_t>(element, values);
      break;
    case 4:
      Append<std::uint16_t>(element, values);
      break;
    case 5:
      Append<std::int32_t>(element, values);
      break;
    case 6:
      Append<std::uint32_t>(element, values);
      break;
    case 7:
      Append<float>(element, values);
      break;
    case 9:
      Append<double>(element, values);
      break;
    case 12:
      Append<std::int64_t>(element, values);
      break;
    case 13:
      Append<std::uint64_t>(element, values);
      break;
    default:
      reader.Fail("numbers of type " + std::to_string(element.type));
  }
  return values;
}

Bytes Unpack(const Element& element, const Reader& reader) {
  Bytes out(std::max<std::size_t>(4096, element.size * 4));
  z_stream stream;
  std::memset(&stream, 0, sizeof stream);
  if (inflateInit(&stream) != Z_OK) reader.Fail("zlib can't start");
  stream.next_in = const_cast<Bytef*>(element.data);
  stream.avail_in = static_cast<uInt>(element.size);
  int status = Z_OK;
  while (status == Z_OK && out.size() <= kMaxBytes) {
    if (stream.total_out >= out.size()) out.resize(out.size() * 2);
    stream.next_out = out.data() + stream.total_out;
    stream.avail_out = static_cast<uInt>(out.size() - stream.total_out);
    status = inflate(&stream, Z_NO_FLUSH);
    if (status == Z_BUF_ERROR || (status == Z_OK && stream.avail_in == 0 && stream.avail_out > 0)) break;
  }
  out.resize(stream.total_out);
  inflateEnd(&stream);
  if (status != Z_STREAM_END) reader.Fail("a compressed variable can't be unpacked");
  return out;
}

// Column by column (MATLAB's order) to row by row.
std::vector<double> FromFull(const std::vector<double>& columns, std::size_t n, const Reader& reader) {
  if (columns.size() < n * n) reader.Fail("fewer numbers than the size of the matrix says");
  std::vector<double> values(n * n);
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t r = 0; r < n; ++r) values[r * n + c] = columns[c * n + r];
  }
  return values;
}

std::vector<double> FromSparse(Reader& matrix, std::size_t n) {
  const std::vector<double> rows = Numbers(matrix.Next(), matrix);
  const std::vector<double> starts = Numbers(matrix.Next(), matrix);
  const std::vector<double> numbers = Numbers(matrix.Next(), matrix);
  if (starts.size() < n + 1) matrix.Fail("a sparse matrix without column starts");
  std::vector<double> values(n * n, 0.0);
  for (std::size_t c = 0; c < n; ++c) {
    const bool in_order = starts[c] >= 0 && starts[c + 1] >= starts[c];  // false for NaN, too
    if (!in_order || starts[c + 1] > static_cast<double>(std::min(rows.size(), numbers.size()))) {
      matrix.Fail("a sparse matrix with wrong column starts");
    }
    for (std::size_t k = static_cast<std::size_t>(starts[c]); k < static_cast<std::size_t>(starts[c + 1]);
         ++k) {
      if (!(rows[k] >= 0 && rows[k] < static_cast<double>(n)))
        matrix.Fail("a sparse matrix with a row that is not there");
      values[static_cast<std::size_t>(rows[k]) * n + c] = numbers[k];
    }
  }
  return values;
}

// Returns an empty vector if this variable is no square numeric matrix.
std::vector<double> ReadVariable(const Element& element, const std::string& file, int& size) {
  Reader matrix(element.data, element.size, file);
  if (matrix.AtEnd()) return {};
  const std::vector<double> flags = Numbers(matrix.Next(), matrix);
  if (flags.empty() || !(flags[0] >= 0 && flags[0] <= std::numeric_limits<std::uint32_t>::max()))
    matrix.Fail("a variable without flags");
  const std::uint32_t array_class = static_cast<std::uint32_t>(flags[0]) & 0xffu;
  if (array_class < kSparseClass || array_class > 15) return {};  // cells, structures, text
  const std::vector<double> dimensions = Numbers(matrix.Next(), matrix);
  if (dimensions.size() != 2 || dimensions[0] != dimensions[1] || dimensions[0] < 2) return {};
  if (dimensions[0] > kMaxSize) matrix.Fail("a matrix of more than " + std::to_string(kMaxSize) + " rows");
  size = static_cast<int>(dimensions[0]);
  const std::size_t n = static_cast<std::size_t>(size);
  matrix.Next();  // the variable's name
  if (array_class == kSparseClass) return FromSparse(matrix, n);
  const Element data = matrix.Next();
  return FromFull(Numbers(data, matrix), n, matrix);
}

}  // namespace

std::vector<double> ReadMatSquareMatrix(const std::filesystem::path& file, int& size) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file.string() + ": can't be opened; check the path of the ground truth");
  const Bytes bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (bytes.size() < kHeader)
    throw InputError(file.string() + ": damaged MATLAB file (it has no header); copy it again");
  if (bytes[126] != 'I' || bytes[127] != 'M') {
    throw InputError(file.string() +
                     ": a MATLAB file of a big-endian machine or another version; save it with -v6 or -v7");
  }
  Reader reader(bytes.data() + kHeader, bytes.size() - kHeader, file.string());
  while (!reader.AtEnd()) {
    Element element = reader.Next();
    Bytes unpacked;
    if (element.type == kCompressed) {
      unpacked = Unpack(element, reader);
      element = Reader(unpacked.data(), unpacked.size(), file.string()).Next();
    }
    if (element.type != kMatrix) continue;
    std::vector<double> values = ReadVariable(element, file.string(), size);
    if (!values.empty()) return values;
  }
  throw InputError(file.string() + ": holds no square numeric matrix; a loop matrix is one");
}

}  // namespace tutti
