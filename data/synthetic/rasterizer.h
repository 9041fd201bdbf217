// A small software renderer: textured parallelograms with depth buffer, trilinear mip maps and supersampling.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::synthetic {

/// A grey texture with its mip levels. Sides are powers of two; it repeats.
class Texture {
 public:
  /// `image`: CV_8UC1 with power-of-two sides.
  explicit Texture(const cv::Mat& image);
  int Width() const { return levels_[0].width; }
  int Height() const { return levels_[0].height; }

  /// A mip level as inner loops read it.
  struct Texels {
    const std::uint8_t* begin;
    int width, height;
  };
  /// Between two mip levels: `fraction` of the way from `fine` to `coarse`.
  struct Detail {
    Texels fine, coarse;
    float fraction;
  };
  /// `lod`: log2 of texels per sample.
  Detail At(float lod) const;
  /// For sanitizers (core/inner_loops.h).
  void CheckReadable() const;

 private:
  struct Level {
    int width, height;
    std::vector<std::uint8_t> texels;
    Texels Seen() const { return {texels.data(), width, height}; }
  };
  std::vector<Level> levels_;
};

/// A textured parallelogram. It has one visible side: that from which edge_u points to the right and edge_v
/// down.
struct Face {
  Eigen::Vector3d corner;  ///< of texture coordinate (0, 0) [m]
  Eigen::Vector3d edge_u;  ///< to the corner (repeat_u, 0)
  Eigen::Vector3d edge_v;  ///< to the corner (0, repeat_v)
  int texture = 0;
  double repeat_u = 1, repeat_v = 1;  ///< how often the texture repeats along the edges
  double offset_u = 0, offset_v = 0;  ///< texture coordinate of the corner
  bool emits = false;                 ///< not shaded (the sky)
};

/// A face from its corner and edges.
inline Face Quad(const Eigen::Vector3d& corner, const Eigen::Vector3d& edge_u, const Eigen::Vector3d& edge_v,
                 int texture, double repeat_u = 1, double repeat_v = 1) {
  Face face;
  face.corner = corner;
  face.edge_u = edge_u;
  face.edge_v = edge_v;
  face.texture = texture;
  face.repeat_u = repeat_u;
  face.repeat_v = repeat_v;
  return face;
}

/// Light of a moment: brightness = gain * (ambient + (1 - ambient) * max(0, n . towards_sun)), then
/// value^gamma.
struct Light {
  Eigen::Vector3d towards_sun = Eigen::Vector3d(0.4, -0.5, 0.76).normalized();
  double ambient = 0.72;
  double gain = 1.1;
  double gamma = 1.0;
};

/// What a camera sees.
struct Rendering {
  cv::Mat image;    ///< CV_32FC1, grey level 0..255
  cv::Mat depth_m;  ///< CV_32FC1, z in the camera frame [m]; 0 where there is nothing
};

/// Renders faces as seen from T_world_camera. Deterministic.
Rendering Render(const std::vector<Face>& faces, const std::vector<Texture>& textures,
                 const PinholeCamera& camera, const Pose& T_world_camera, const Light& light,
                 int supersample);

/// Looks of a box: its two ends (`front`), its two long sides, its top.
struct BoxTextures {
  int front = 0, side = 0, top = 0;
};
/// Appends the five faces (no bottom) of a box that stands on `base_center`, its length (size.x) turned by
/// yaw about z.
void AppendBox(std::vector<Face>& faces, const Eigen::Vector3d& base_center, const Eigen::Vector3d& size,
               double yaw, const BoxTextures& textures);

}  // namespace tutti::synthetic
