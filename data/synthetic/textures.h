// Procedural textures: facades, ground, signs, cars, furniture. All grey, all from a seed.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace tutti::synthetic {

/// Sums of smooth noise, mean 0, about +-amplitude; the wave length halves from `coarse` down to 2 texels.
cv::Mat Noise(int width, int height, int coarse, double amplitude, std::uint64_t seed);

cv::Mat FacadeTexture(
    std::uint64_t seed);  ///< 512x512: a whole front, roof edge at the top, door at the bottom
cv::Mat WallTexture(std::uint64_t seed);  ///< 256x256: plaster or bricks, without windows
cv::Mat RoadTexture(std::uint64_t seed,
                    bool crossing);  ///< 512x512: a street's full width (along u) and as much of its length
cv::Mat GroundTexture(std::uint64_t seed);          ///< 256x256: earth and grass
cv::Mat SignTexture(std::uint64_t seed);            ///< 128x128: a poster or shop sign, no two alike
cv::Mat CarTexture(std::uint64_t seed, bool side);  ///< 128x64: side or front of a car
/// 512x256: side of a bus or lorry with windows, posters and dirt, or of a plain van, no two alike
cv::Mat BusTexture(std::uint64_t seed);
cv::Mat FoliageTexture(std::uint64_t seed);  ///< 128x128
cv::Mat SkyTexture(std::uint64_t seed);      ///< 512x256: faint clouds
cv::Mat WoodTexture(std::uint64_t seed);     ///< 256x256: planks or boards of furniture
cv::Mat ShelfTexture(std::uint64_t seed);    ///< 256x256: rows of books
cv::Mat PlasterTexture(std::uint64_t seed);  ///< 256x256: a painted wall with almost nothing to see
cv::Mat CurtainTexture(std::uint64_t seed);  ///< 256x64: upright folds, soft and without a mark
cv::Mat PaintTexture(std::uint64_t seed);    ///< 256x256: painted wood, with almost nothing to see
/// 256x256: 4x4 panels of a floor or ceiling, with so many stains and scratches
cv::Mat PanelTexture(std::uint64_t seed, double grey, int marks);
cv::Mat DoorTexture(std::uint64_t seed);       ///< 128x256
cv::Mat LampTexture();                         ///< 64x64
cv::Mat RadiatorTexture();                     ///< 128x64
cv::Mat WallpaperTexture(std::uint64_t seed);  ///< 512x512

}  // namespace tutti::synthetic
