// The words of a saved vocabulary.
#pragma once

#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "core/byte_stream.h"
#include "loopclosure/store/packed_mat.h"
#include "loopclosure/vocabulary/word_storage.h"

namespace tutti::internal {

/// Appends all words, ascending, with their descriptors of a type (CV_8U or CV_32F). Of one that is a row of
/// `known`, which whoever loads it must have in the same order, the number of the row is saved.
void SaveWords(const WordStorage& storage, int type, const std::vector<PackedMat>& known, ByteWriter& out);

/// Takes a word: its id, and its descriptor until it returns.
using WordSink = std::function<void(int word, const std::uint8_t* descriptor)>;

/// Gives, ascending, what SaveWords wrote. Throws InputError if it is damaged.
void LoadWords(const WordStorage& storage, int type, const std::vector<PackedMat>& known, ByteReader& in,
               const WordSink& sink);

}  // namespace tutti::internal
