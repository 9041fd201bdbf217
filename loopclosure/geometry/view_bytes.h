// A View as bytes, for saved detectors and the long-term memory's file.
#pragma once

#include "core/byte_stream.h"
#include "loopclosure/geometry/verification.h"

namespace tutti::internal {

void SaveView(const View& view, ByteWriter& out);
/// Throws InputError.
View LoadView(ByteReader& in);

}  // namespace tutti::internal
