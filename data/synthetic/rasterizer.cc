#include "data/synthetic/rasterizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "core/inner_loops.h"

namespace tutti::synthetic {

Texture::Detail Texture::At(float lod) const {
  const float level = std::clamp(lod, 0.0F, static_cast<float>(levels_.size() - 1));
  const std::size_t low = static_cast<std::size_t>(level), next = std::min(low + 1, levels_.size() - 1);
  return {levels_[low].Seen(), levels_[next].Seen(), level - static_cast<float>(low)};
}

void Texture::CheckReadable() const {
  for (const Level& level : levels_)
    internal::CheckReadable(level.texels.data(),
                            static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height));
}

namespace {

constexpr double kNear = 0.05;  // [m]

// The corners of a face in front of the near plane, in the camera frame: at most five.
struct Polygon {
  std::array<Eigen::Vector3d, 8> points;
  int size = 0;
};

Polygon ClipToNear(const std::array<Eigen::Vector3d, 4>& corners) {
  Polygon out;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d& a = corners[static_cast<std::size_t>(i)];
    const Eigen::Vector3d& b = corners[static_cast<std::size_t>((i + 1) % 4)];
    const bool a_in = a.z() >= kNear, b_in = b.z() >= kNear;
    if (a_in) out.points[static_cast<std::size_t>(out.size++)] = a;
    if (a_in != b_in) {
      const double t = (kNear - a.z()) / (b.z() - a.z());
      out.points[static_cast<std::size_t>(out.size++)] = a + t * (b - a);
    }
  }
  return out;
}

// A function that is linear in the pixel: value(x, y) = c + dx * x + dy * y.
struct Linear {
  double c, dx, dy;
  double At(double x, double y) const { return c + dx * x + dy * y; }
};

// Buffers of one rendering.
struct Target {
  int width, height;
  double fx, fy, cx, cy;
  std::vector<float> grey, inverse_z;

  // The ray ((x - cx) / fx, (y - cy) / fy, 1), dotted with n.
  Linear DotRay(const Eigen::Vector3d& n) const {
    return {n.z() - n.x() * cx / fx - n.y() * cy / fy, n.x() / fx, n.y() / fy};
  }
};

// One face, ready to fill. A point of the face is p0 + a eu + b ev = z d with the ray d; with N = eu x ev
// this gives a = d.(ev x p0) / d.N, b = d.(p0 x eu) / d.N, 1/z = d.N / p0.N: quotients of linear functions of
// the pixel.
struct Fill {
  Linear u, v, n;
  double inverse_z_scale;
  float shade;
  const Texture* texture;
};

// At (u, v) in texture units (1 = the whole texture).
TUTTI_CHECKED_AS_A_WHOLE inline float Bilinear(const Texture::Texels& texels, float u, float v) {
  const float x = u * static_cast<float>(texels.width) - 0.5F,
              y = v * static_cast<float>(texels.height) - 0.5F;
  int ix = static_cast<int>(x), iy = static_cast<int>(y);  // floor: without SSE 4.1, std::floor is a call
  ix -= x < static_cast<float>(ix) ? 1 : 0;
  iy -= y < static_cast<float>(iy) ? 1 : 0;
  const float ax = x - static_cast<float>(ix), ay = y - static_cast<float>(iy);
  const int mask_x = texels.width - 1, mask_y = texels.height - 1;
  const int x0 = ix & mask_x, x1 = (x0 + 1) & mask_x;
  const auto width = static_cast<std::size_t>(texels.width);
  const std::uint8_t* row0 = texels.begin + static_cast<std::size_t>(iy & mask_y) * width;
  const std::uint8_t* row1 = texels.begin + static_cast<std::size_t>((iy + 1) & mask_y) * width;
  const float top = row0[x0] + ax * static_cast<float>(row0[x1] - row0[x0]);
  const float bottom = row1[x0] + ax * static_cast<float>(row1[x1] - row1[x0]);
  return top + ay * (bottom - top);
}

// Pixels of a row that have one level of detail. `nu`, `nv`, `nn`: f.u, f.v and f.n at the first of them.
TUTTI_CHECKED_AS_A_WHOLE inline void FillSpan(const Fill& f, const Texture::Detail& detail, double nu,
                                              double nv, double nn, int count, float* grey, float* depth) {
  for (int x = 0; x < count; ++x, nu += f.u.dx, nv += f.v.dx, nn += f.n.dx) {
    const float inverse_z = static_cast<float>(nn * f.inverse_z_scale);
    if (inverse_z <= depth[x]) continue;
    depth[x] = inverse_z;
    const double r = 1.0 / nn;
    const float u = static_cast<float>(nu * r), v = static_cast<float>(nv * r);
    float texel = Bilinear(detail.fine, u, v);
    if (detail.fraction > 0.0F) texel += detail.fraction * (Bilinear(detail.coarse, u, v) - texel);
    grey[x] = f.shade * texel;
  }
}

void FillRow(Target& target, const Fill& f, int y, int x_begin, int x_end) {
  constexpr int kSpan = 16;  // pixels with one level of detail
  float* grey = &target.grey[static_cast<std::size_t>(y) * static_cast<std::size_t>(target.width)];
  float* depth = &target.inverse_z[static_cast<std::size_t>(y) * static_cast<std::size_t>(target.width)];
  internal::CheckWritable(grey + x_begin, static_cast<std::size_t>(x_end - x_begin));
  internal::CheckWritable(depth + x_begin, static_cast<std::size_t>(x_end - x_begin));
  const double tw = f.texture->Width(), th = f.texture->Height();
  for (int x0 = x_begin; x0 < x_end; x0 += kSpan) {
    const int x1 = std::min(x0 + kSpan, x_end);
    const double middle = 0.5 * (x0 + x1 - 1);
    const double w = 1.0 / f.n.At(middle, y);
    const double u = f.u.At(middle, y) * w, v = f.v.At(middle, y) * w;
    const double ux = (f.u.dx - u * f.n.dx) * w * tw, uy = (f.u.dy - u * f.n.dy) * w * tw;
    const double vx = (f.v.dx - v * f.n.dx) * w * th, vy = (f.v.dy - v * f.n.dy) * w * th;
    // Texels per sample along the longer and the shorter axis. The shorter one alone would alias at grazing
    // angles, the longer one alone would blur the ground away; samples are dense enough for a factor of 3.
    const double along_x = ux * ux + vx * vx, along_y = uy * uy + vy * vy;
    const double texels = std::max({std::min(along_x, along_y), std::max(along_x, along_y) / 9.0, 1e-12});
    const float lod = 0.5F * static_cast<float>(std::log2(texels));
    FillSpan(f, f.texture->At(lod), f.u.At(x0, y), f.v.At(x0, y), f.n.At(x0, y), x1 - x0, grey + x0,
             depth + x0);
  }
}

void FillPolygon(Target& target, const Polygon& polygon, const Fill& f) {
  std::array<Eigen::Vector2d, 8> p;
  double top = 1e30, bottom = -1e30;
  for (int i = 0; i < polygon.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector3d& q = polygon.points[k];
    p[k] = {target.fx * q.x() / q.z() + target.cx, target.fy * q.y() / q.z() + target.cy};
    top = std::min(top, p[k].y());
    bottom = std::max(bottom, p[k].y());
  }
  const int y_begin = static_cast<int>(std::ceil(std::max(top, 0.0)));
  const int y_end = static_cast<int>(std::min(std::floor(bottom) + 1.0, static_cast<double>(target.height)));
  for (int y = y_begin; y < y_end; ++y) {
    double left = 1e30, right = -1e30;
    for (int i = 0; i < polygon.size; ++i) {
      const Eigen::Vector2d& a = p[static_cast<std::size_t>(i)];
      const Eigen::Vector2d& b = p[static_cast<std::size_t>((i + 1) % polygon.size)];
      if ((a.y() > y) == (b.y() > y)) continue;
      const double x = a.x() + (b.x() - a.x()) * (y - a.y()) / (b.y() - a.y());
      left = std::min(left, x);
      right = std::max(right, x);
    }
    if (left > right) continue;
    const int x_begin = static_cast<int>(std::ceil(std::max(left, 0.0)));
    const int x_end = static_cast<int>(std::min(std::ceil(right), static_cast<double>(target.width)));
    if (x_begin < x_end) FillRow(target, f, y, x_begin, x_end);
  }
}

void DrawFace(Target& target, const Face& face, const Texture& texture, const Pose& T_camera_world,
              float shade) {
  const Eigen::Matrix3d R = T_camera_world.rotation.toRotationMatrix();
  const Eigen::Vector3d p0 = R * face.corner + T_camera_world.translation;
  const Eigen::Vector3d eu = R * face.edge_u, ev = R * face.edge_v;
  const Eigen::Vector3d normal = eu.cross(ev);  // points away from the viewer
  const double distance = p0.dot(normal);
  if (distance <= 1e-9) return;
  const Polygon polygon = ClipToNear({p0, p0 + eu, p0 + eu + ev, p0 + ev});
  if (polygon.size < 3) return;
  const auto plus = [](const Linear& l, double scale, const Linear& m, double add) {
    return Linear{l.c * scale + m.c * add, l.dx * scale + m.dx * add, l.dy * scale + m.dy * add};
  };
  Fill fill;
  fill.n = target.DotRay(normal);
  fill.u = plus(target.DotRay(ev.cross(p0)), face.repeat_u, fill.n, face.offset_u);
  fill.v = plus(target.DotRay(p0.cross(eu)), face.repeat_v, fill.n, face.offset_v);
  fill.inverse_z_scale = 1.0 / distance;
  fill.shade = shade;
  fill.texture = &texture;
  FillPolygon(target, polygon, fill);
}

// Mean grey of the samples of each pixel, and the depth at its centre: on a plane 1/z is linear, so the mean
// of the samples is exact; across an edge the nearest sample stands.
Rendering Reduce(const Target& target, const PinholeCamera& camera, int supersample, double gamma) {
  Rendering out;
  out.image.create(camera.height, camera.width, CV_32FC1);
  out.depth_m.create(camera.height, camera.width, CV_32FC1);
  const float norm = 1.0F / static_cast<float>(supersample * supersample);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      float grey = 0, sum = 0, nearest = 0, farthest = 1e30F;
      for (int j = 0; j < supersample; ++j) {
        const std::size_t row =
            static_cast<std::size_t>(y * supersample + j) * static_cast<std::size_t>(target.width);
        for (int i = 0; i < supersample; ++i) {
          const std::size_t at = row + static_cast<std::size_t>(x * supersample + i);
          grey += target.grey[at];
          sum += target.inverse_z[at];
          nearest = std::max(nearest, target.inverse_z[at]);
          farthest = std::min(farthest, target.inverse_z[at]);
        }
      }
      float value = std::clamp(grey * norm, 0.0F, 255.0F);
      if (gamma != 1.0) value = 255.0F * std::pow(value / 255.0F, static_cast<float>(gamma));
      out.image.at<float>(y, x) = value;
      const float inverse = nearest > 1.05F * farthest ? nearest : sum * norm;
      out.depth_m.at<float>(y, x) = inverse > 0 ? 1.0F / inverse : 0.0F;
    }
  }
  return out;
}

}  // namespace

Texture::Texture(const cv::Mat& image) {
  cv::Mat level = image;
  while (true) {
    Level l{level.cols, level.rows, {}};
    for (int y = 0; y < level.rows; ++y)
      l.texels.insert(l.texels.end(), level.ptr(y), level.ptr(y) + level.cols);
    levels_.push_back(std::move(l));
    if (level.cols == 1 && level.rows == 1) break;
    cv::Mat half;
    cv::resize(level, half, cv::Size(std::max(1, level.cols / 2), std::max(1, level.rows / 2)), 0, 0,
               cv::INTER_AREA);
    level = half;
  }
}

Rendering Render(const std::vector<Face>& faces, const std::vector<Texture>& textures,
                 const PinholeCamera& camera, const Pose& T_world_camera, const Light& light,
                 int supersample) {
  // The sample (i, j) of s x s in pixel (x, y) lies at x + (i + 0.5) / s - 0.5.
  const double s = supersample;
  Target target{camera.width * supersample,
                camera.height * supersample,
                camera.fx * s,
                camera.fy * s,
                (camera.cx + 0.5) * s - 0.5,
                (camera.cy + 0.5) * s - 0.5,
                {},
                {}};
  const std::size_t samples =
      static_cast<std::size_t>(target.width) * static_cast<std::size_t>(target.height);
  target.grey.assign(samples, 0.0F);
  target.inverse_z.assign(samples, 0.0F);

  for (const Texture& texture : textures) texture.CheckReadable();

  // Near faces first, so that hidden samples cost no texture access.
  const Pose T_camera_world = T_world_camera.Inverse();
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Face& f = faces[i];
    const Eigen::Vector3d center = f.corner + 0.5 * (f.edge_u + f.edge_v);
    const double reach = 0.5 * (f.edge_u.norm() + f.edge_v.norm());
    if ((T_camera_world * center).z() + reach < kNear) continue;
    order.emplace_back((center - T_world_camera.translation).norm() - (reach > 40 ? 0 : 0.5 * reach), i);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [distance, i] : order) {
    const Face& face = faces[i];
    double shade = 1.0;
    if (!face.emits) {
      const Eigen::Vector3d normal = -face.edge_u.cross(face.edge_v).normalized();  // towards the viewer
      shade = light.ambient + (1.0 - light.ambient) * std::max(0.0, normal.dot(light.towards_sun));
    }
    DrawFace(target, face, textures[static_cast<std::size_t>(face.texture)], T_camera_world,
             static_cast<float>(light.gain * shade));
  }
  return Reduce(target, camera, supersample, light.gamma);
}

void AppendBox(std::vector<Face>& faces, const Eigen::Vector3d& base_center, const Eigen::Vector3d& size,
               double yaw, const BoxTextures& textures) {
  const Eigen::Vector3d x(std::cos(yaw), std::sin(yaw), 0), y(-std::sin(yaw), std::cos(yaw), 0), z(0, 0, 1);
  const Eigen::Vector3d top = base_center + size.z() * z;
  const auto add = [&](const Eigen::Vector3d& corner, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
                       int texture) { faces.push_back(Quad(corner, u, v, texture)); };
  const Eigen::Vector3d hx = 0.5 * size.x() * x, hy = 0.5 * size.y() * y, down = -size.z() * z;
  // Seen from outside, edge_u goes to the right and edge_v down.
  add(top + hx - hy, 2 * hy, down, textures.front);   // +x side
  add(top - hx + hy, -2 * hy, down, textures.front);  // -x side
  add(top + hx + hy, -2 * hx, down, textures.side);   // +y side
  add(top - hx - hy, 2 * hx, down, textures.side);    // -y side
  add(top - hx + hy, 2 * hx, -2 * hy, textures.top);  // top
}

}  // namespace tutti::synthetic
