// What is too small an image for every member.
#pragma once

namespace tutti {

constexpr int kMinSide = 16;  ///< smaller images hold no feature of any member [px]

}  // namespace tutti
