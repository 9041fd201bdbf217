// The state of objects as bytes, for saved maps: one description serves for both directions, so that what is
// written and what is read can't differ. Not installed.
//
//   template <class Archive>
//   void State(Archive& archive) { archive(pose_, landmarks_); }     // a member of the class, or
//   template <class Archive>
//   void State(Archive& archive, LoopEdge& edge) { ... }             // beside a struct, in its namespace
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <typeinfo>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/byte_stream.h"
#include "tutti/core/options.h"
#include "tutti/core/pose.h"

namespace tutti::internal {

/// Objects that several others point to: each is written once. One for all archives of a file.
class SharedObjectsOut {
 public:
  /// Number of the object; `*is_new`: it was not asked for before. It must live as long as this.
  std::uint32_t NumberOf(const void* object, bool* is_new) {
    const auto [found, inserted] =
        numbers_.try_emplace(object, static_cast<std::uint32_t>(numbers_.size()) + 1);
    *is_new = inserted;
    return found->second;
  }

 private:
  std::unordered_map<const void*, std::uint32_t> numbers_;  // from 1; looked up, never gone through
};

/// The same for reading.
class SharedObjectsIn {
 public:
  std::uint32_t NextNumber() const { return static_cast<std::uint32_t>(objects_.size()) + 1; }
  template <class T>
  void Add(std::shared_ptr<T> object) {
    objects_.push_back({std::move(object), &typeid(T)});
  }
  /// The object with a number below NextNumber; null if that is of another type, or 0.
  template <class T>
  std::shared_ptr<T> Find(std::uint32_t number) const {
    if (number < 1 || *objects_[number - 1].type != typeid(T)) return nullptr;
    return std::static_pointer_cast<T>(objects_[number - 1].object);
  }

 private:
  struct Object {
    std::shared_ptr<void> object;
    const std::type_info* type;
  };
  std::vector<Object> objects_;
};

/// A vector as ByteWriter::PutPlanes writes it.
struct Planes {
  std::vector<float>* values;
};

/// Numbers of either sign that are small as a rule: seven bits a byte.
struct SmallNumbers {
  std::vector<int>* values;
};

/// Numbers from 0 on that grow: the steps between them, seven bits a byte.
struct GrowingNumbers {
  std::vector<int>* values;
};

template <class Archive, class T, class = void>
struct HasStateMember : std::false_type {};
template <class Archive, class T>
struct HasStateMember<Archive, T, std::void_t<decltype(std::declval<T&>().State(std::declval<Archive&>()))>>
    : std::true_type {};

template <class T>
inline constexpr bool kIsPlain = (std::is_arithmetic_v<T> || std::is_enum_v<T>)&&!std::is_same_v<T, bool>;

/// Writes values: numbers, texts, options, Eigen's matrices, what the standard library holds them in, and
/// what has a State.
class StateWriter {
 public:
  static constexpr bool kReading = false;

  /// `shared` must outlive this object.
  explicit StateWriter(SharedObjectsOut* shared) : shared_(shared) {}

  template <class... T>
  void operator()(const T&... values) {
    (Put(values), ...);
  }
  /// Bytes whose number is known when they are read.
  void Raw(const void* data, std::size_t size) { out_.PutRaw(data, size); }
  /// What was written, which the writer has no more.
  std::string Take() { return out_.Take(); }

 private:
  template <class T>
  void Put(const T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      out_.Put<std::uint8_t>(value ? 1 : 0);
    } else if constexpr (kIsPlain<T>) {
      out_.Put(value);
    } else if constexpr (kHasOptions<T>) {
      ForEachOption(value, [this](const OptionText& text, const auto& field) {
        out_.PutString(text.name);
        Put(field);
      });
    } else if constexpr (HasStateMember<StateWriter, T>::value) {
      const_cast<T&>(value).State(*this);  // it only reads: kReading is false
    } else {
      State(*this, const_cast<T&>(value));
    }
  }
  void Put(const std::string& text) { out_.PutString(text); }
  void Put(const Planes& planes) { out_.PutPlanes(*planes.values); }
  void Put(const SmallNumbers& numbers) {
    out_.PutVarint(numbers.values->size());
    for (const int value : *numbers.values) out_.PutSignedVarint(value);
  }
  void Put(const GrowingNumbers& numbers) {
    out_.PutVarint(numbers.values->size());
    std::int64_t least = 0;  // one more than the greatest int does not fit into an int
    for (const int value : *numbers.values) {
      out_.PutVarint(static_cast<std::uint64_t>(value - least));
      least = std::int64_t{value} + 1;
    }
  }
  template <class T, int R, int C>
  void Put(const Eigen::Matrix<T, R, C>& matrix) {
    static_assert(R > 0 && C > 0);
    out_.PutRaw(matrix.data(), sizeof(T) * R * C);
  }
  void Put(const Eigen::Quaterniond& q) { Put(q.coeffs()); }
  void Put(const Pose& pose) { (*this)(pose.rotation, pose.translation); }
  void Put(const Similarity& s) { (*this)(s.scale, s.rotation, s.translation); }
  template <class A, class B>
  void Put(const std::pair<A, B>& pair) {
    (*this)(pair.first, pair.second);
  }
  template <class T>
  void Put(const std::optional<T>& value) {
    Put(value.has_value());
    if (value) Put(*value);
  }
  template <class T>
  void Put(const std::vector<T>& values) {
    static_assert(!std::is_same_v<T, bool>);
    if constexpr (kIsPlain<T>) {
      out_.PutVector(values);
    } else {
      PutAll(values);
    }
  }
  template <class T, std::size_t N>
  void Put(const std::array<T, N>& values) {
    if constexpr (kIsPlain<T>) {
      out_.PutRaw(values.data(), sizeof values);
    } else {
      for (const T& value : values) Put(value);
    }
  }
  template <class T>
  void Put(const std::deque<T>& values) {
    PutAll(values);
  }
  template <class T>
  void Put(const std::set<T>& values) {
    PutAll(values);
  }
  template <class K, class V>
  void Put(const std::map<K, V>& values) {
    PutAll(values);
  }
  template <class T>
  void Put(const std::shared_ptr<T>& object) {
    if (!object) return out_.Put<std::uint32_t>(0);
    bool is_new = false;
    out_.Put(shared_->NumberOf(object.get(), &is_new));
    if (is_new) Put(*object);
  }
  template <class Values>
  void PutAll(const Values& values) {
    out_.Put<std::uint64_t>(values.size());
    for (const auto& value : values) Put(value);
  }

  ByteWriter out_;
  SharedObjectsOut* shared_;
};

/// Reads what StateWriter wrote, into objects of the same types. Throws InputError, with the name of the
/// source, where the bytes end too early or a size is absurd.
class StateReader {
 public:
  static constexpr bool kReading = true;

  /// `bytes` and `shared` must outlive this object; `source`: a file's name, for messages.
  StateReader(std::string_view bytes, std::string source, SharedObjectsIn* shared)
      : in_(bytes, std::move(source)), shared_(shared) {}

  template <class... T>
  void operator()(T&&... values) {
    (Get(values), ...);
  }
  void Raw(void* data, std::size_t size) { in_.GetRaw(data, size); }
  /// Throws InputError unless so many bytes are left: asked before room is made for them.
  void Need(std::uint64_t bytes) const {
    if (bytes > in_.Left()) in_.Damaged("it ends too early");
  }
  /// Throws InputError if something is left.
  void ExpectEnd() const {
    if (!in_.AtEnd()) in_.Damaged("a section is too long");
  }
  [[noreturn]] void Damaged(const std::string& what) const { in_.Damaged(what); }
  /// An index that must be in [first, end).
  void Check(int index, int first, int end, const char* what) const {
    if (index < first || index >= end) in_.Damaged(what);
  }

 private:
  template <class T>
  void Get(T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      value = in_.Get<std::uint8_t>() != 0;
    } else if constexpr (kIsPlain<T>) {
      value = in_.Get<T>();
    } else if constexpr (kHasOptions<T>) {
      ForEachOption(value, [this](const OptionText& text, auto& field) {
        if (in_.GetString() != text.name) in_.Damaged("it is of a tutti with other options");
        Get(field);
      });
    } else if constexpr (HasStateMember<StateReader, T>::value) {
      value.State(*this);
    } else {
      State(*this, value);
    }
  }
  void Get(std::string& text) { text = in_.GetString(); }
  void Get(Planes& planes) { *planes.values = in_.GetPlanes(); }
  void Get(SmallNumbers& numbers) {
    numbers.values->resize(GetShortCount());
    for (int& value : *numbers.values) {
      const std::int64_t read = in_.GetSignedVarint();
      value = static_cast<int>(read);
      if (value != read) in_.Damaged("an impossible number");
    }
  }
  void Get(GrowingNumbers& numbers) {
    numbers.values->resize(GetShortCount());
    int least = 0;
    for (int& value : *numbers.values) {
      const std::uint64_t step = in_.GetVarint();
      if (step >= static_cast<std::uint64_t>(std::numeric_limits<int>::max() - least))
        in_.Damaged("an impossible number");
      value = least + static_cast<int>(step);
      least = value + 1;
    }
  }
  std::size_t GetShortCount() {
    const std::uint64_t count = in_.GetVarint();
    Need(count);
    return static_cast<std::size_t>(count);
  }
  template <class T, int R, int C>
  void Get(Eigen::Matrix<T, R, C>& matrix) {
    in_.GetRaw(matrix.data(), sizeof(T) * R * C);
  }
  void Get(Eigen::Quaterniond& q) { Get(q.coeffs()); }
  void Get(Pose& pose) { (*this)(pose.rotation, pose.translation); }
  void Get(Similarity& s) { (*this)(s.scale, s.rotation, s.translation); }
  template <class A, class B>
  void Get(std::pair<A, B>& pair) {
    (*this)(pair.first, pair.second);
  }
  template <class T>
  void Get(std::optional<T>& value) {
    bool is_there = false;
    Get(is_there);
    value.reset();
    if (is_there) Get(value.emplace());
  }
  template <class T>
  void Get(std::vector<T>& values) {
    if constexpr (kIsPlain<T>) {
      values = in_.GetVector<T>();
    } else {
      values.clear();
      GetEach<T>([&values](T&& value) { values.push_back(std::move(value)); });
    }
  }
  template <class T, std::size_t N>
  void Get(std::array<T, N>& values) {
    if constexpr (kIsPlain<T>) {
      in_.GetRaw(values.data(), sizeof values);
    } else {
      for (T& value : values) Get(value);
    }
  }
  template <class T>
  void Get(std::deque<T>& values) {
    values.clear();
    GetEach<T>([&values](T&& value) { values.push_back(std::move(value)); });
  }
  template <class T>
  void Get(std::set<T>& values) {
    values.clear();
    GetEach<T>([&values](T&& value) { values.insert(values.end(), std::move(value)); });
  }
  template <class K, class V>
  void Get(std::map<K, V>& values) {
    values.clear();
    GetEach<std::pair<K, V>>(
        [&values](std::pair<K, V>&& value) { values.insert(values.end(), std::move(value)); });
  }
  template <class T>
  void Get(std::shared_ptr<T>& object) {
    const auto number = in_.Get<std::uint32_t>();
    using Object = std::remove_const_t<T>;
    if (number > shared_->NextNumber()) in_.Damaged("an object that is nowhere");
    if (number < shared_->NextNumber()) {
      object = shared_->Find<Object>(number);
      if (number > 0 && !object) in_.Damaged("an object of another kind");
      return;
    }
    auto made = std::make_shared<Object>();
    shared_->Add(made);
    Get(*made);
    object = std::move(made);
  }
  template <class T, class Take>
  void GetEach(const Take& take) {
    const std::size_t count = in_.GetCount(1);
    for (std::size_t i = 0; i < count; ++i) {
      T value{};
      Get(value);
      take(std::move(value));
    }
  }

  ByteReader in_;
  SharedObjectsIn* shared_;
};

/// The bytes of values that share no objects with others.
template <class... T>
std::string StateBytes(const T&... values) {
  SharedObjectsOut shared;
  StateWriter out(&shared);
  out(values...);
  return out.Take();
}

/// Reads what StateBytes gave. Throws InputError, with the name of the source, if it is anything else.
template <class... T>
void ReadStateBytes(std::string_view bytes, const std::string& source, T&&... values) {
  SharedObjectsIn shared;
  StateReader in(bytes, source, &shared);
  in(values...);
  in.ExpectEnd();
}

}  // namespace tutti::internal
