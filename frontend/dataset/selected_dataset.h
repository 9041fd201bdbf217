// A part of a data set: from a frame to another, every so many, with noise if wanted.
#pragma once

#include <memory>

#include "tutti/frontend/dataset.h"

namespace tutti {

/// The frames options.start, start + stride, ... before options.end of `whole`, which keep their stamps and
/// their numbers (InputFrame::index), with options.noise. `whole` itself if that is all it has. Throws
/// InputError for an end that is not after the start, and if all of a stored data set's frames are left out;
/// `name` is what the message calls it.
std::unique_ptr<Dataset> SelectFrames(std::unique_ptr<Dataset> whole, const DatasetOptions& options,
                                      const std::string& name);

}  // namespace tutti
