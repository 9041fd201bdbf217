// What is refused of a frame that a program gives.
#pragma once

#include "tutti/frontend/frame.h"

#pragma GCC visibility push(default)  // of SlamSystem, too
namespace tutti {

/// Throws InputError that names frame and field: an image of another type or size than InputFrame and the rig
/// say, or none; a right, depth or mask image that does not fit it. With InputFrame::features the images are
/// not looked at again, and may be absent. Without a calibration, colour and 16 bit are fine, as for
/// LoopDetector.
void CheckFrame(const InputFrame& frame, const CameraRig& rig);

}  // namespace tutti
#pragma GCC visibility pop
