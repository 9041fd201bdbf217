#include "apps/dense/stages.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/numbers.h"
#include "core/parallel.h"

namespace tutti {
namespace {

// Corner c of a cube is at (c & 1, c >> 1 & 1, c >> 2). Edge 3 c + a leads from corner c along axis a.
constexpr int kCorners = 8, kEdges = 24;
using Polygon = std::vector<int>;  // of edges

int EdgeBetween(int a, int b) {
  const int axis = (a ^ b) == 1 ? 0 : (a ^ b) == 2 ? 1 : 2;
  return 3 * std::min(a, b) + axis;
}

// The six faces, their corners anticlockwise as seen from outside.
constexpr std::array<std::array<int, 4>, 6> kFaces = {
    {{{0, 4, 6, 2}}, {{1, 3, 7, 5}}, {{0, 1, 5, 4}}, {{2, 6, 7, 3}}, {{0, 2, 3, 1}}, {{4, 5, 7, 6}}}};

// The polygons that part the corners behind the surface (the bits of `behind`) from the others. On each face
// a line cuts off each run of corners that are behind. It goes from the edge where the run begins, as one
// walks round the face, to that where it ends; there the next face's line begins. So the lines form closed
// polygons, anticlockwise as seen from before the surface, and cubes that share a face agree about it, also
// where two opposite corners are behind.
std::vector<Polygon> PolygonsOf(int behind) {
  std::array<int, kEdges> next;
  next.fill(-1);
  const auto is_behind = [behind](int corner) { return (behind >> corner & 1) != 0; };
  for (const std::array<int, 4>& face : kFaces) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (!is_behind(face[i]) || is_behind(face[(i + 1) % 4])) continue;  // a run ends after corner i
      std::size_t first = i;
      while (is_behind(face[(first + 3) % 4])) first = (first + 3) % 4;
      next[static_cast<std::size_t>(EdgeBetween(face[(first + 3) % 4], face[first]))] =
          EdgeBetween(face[i], face[(i + 1) % 4]);
    }
  }
  std::vector<Polygon> polygons;
  for (int edge = 0; edge < kEdges; ++edge) {
    Polygon polygon;
    for (int at = edge; next[static_cast<std::size_t>(at)] >= 0;) {
      polygon.push_back(at);
      at = std::exchange(next[static_cast<std::size_t>(at)], -1);
    }
    if (!polygon.empty()) polygons.push_back(polygon);
  }
  return polygons;
}

const std::array<std::vector<Polygon>, 256>& AllPolygons() {
  static const std::array<std::vector<Polygon>, 256> all = [] {
    std::array<std::vector<Polygon>, 256> made;
    for (int behind = 0; behind < 256; ++behind) made[static_cast<std::size_t>(behind)] = PolygonsOf(behind);
    return made;
  }();
  return all;
}

// A vertex, by the edge that it lies on: 3 * 512 * block + 3 * voxel + axis.
using EdgeNumber = std::uint64_t;
using EdgeTriangle = std::array<EdgeNumber, 3>;

// The voxels of a block and of the next ones: what its 8 x 8 x 8 cubes need.
class BlockSurroundings {
 public:
  BlockSurroundings(const VoxelBlocks& blocks, int block, int min_frames)
      : blocks_(blocks), min_frames_(min_frames) {
    for (int n = 0; n < kCorners; ++n) {
      const Eigen::Vector3i step(n & 1, n >> 1 & 1, n >> 2);
      numbers_[static_cast<std::size_t>(n)] = n == 0 ? block : blocks.Find(blocks.corner(block) + step);
    }
  }

  // The number of a voxel, counted over all blocks; x, y, z: 0 to 8. Its block must be there.
  EdgeNumber Number(int x, int y, int z) const {
    const int block = numbers_[internal::Index((x >> 3) + 2 * (y >> 3) + 4 * (z >> 3))];
    const int voxel = (x & 7) + kBlockSide * ((y & 7) + kBlockSide * (z & 7));
    return static_cast<EdgeNumber>(block) * kBlockVoxels + static_cast<EdgeNumber>(voxel);
  }
  // The voxel, if enough frames measured it.
  const Voxel* At(int x, int y, int z) const {
    const int block = numbers_[internal::Index((x >> 3) + 2 * (y >> 3) + 4 * (z >> 3))];
    if (block < 0) return nullptr;
    const int at = (x & 7) + kBlockSide * ((y & 7) + kBlockSide * (z & 7));
    const Voxel& voxel = blocks_.block(block)[static_cast<std::size_t>(at)];
    return voxel.frames >= min_frames_ && voxel.weight > 0 ? &voxel : nullptr;
  }

 private:
  const VoxelBlocks& blocks_;
  const int min_frames_;
  std::array<int, kCorners> numbers_;
};

// Along an edge of a cube on a surface the distance changes by a voxel, seen at a slant by up to this many.
// More is the border of what hides something, where the band's end meets free space: no surface was seen
// there.
constexpr float kSteepestVoxels = 3;

// Appends the triangles of a cube.
void Triangulate(const BlockSurroundings& around, int x, int y, int z, float steepest,
                 std::vector<EdgeTriangle>* triangles) {
  std::array<float, kCorners> distances;
  int behind = 0;
  for (int c = 0; c < kCorners; ++c) {
    const Voxel* voxel = around.At(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
    if (voxel == nullptr) return;
    distances[static_cast<std::size_t>(c)] = voxel->distance;
    if (voxel->distance < 0) behind |= 1 << c;
  }
  const auto number = [&](int edge) {
    const int c = edge / 3;
    return 3 * around.Number(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)) + static_cast<EdgeNumber>(edge % 3);
  };
  const auto is_steep = [&](int edge) {
    const int from = edge / 3, to = from | 1 << edge % 3;
    return std::abs(distances[static_cast<std::size_t>(from)] - distances[static_cast<std::size_t>(to)]) >
           steepest;
  };
  for (const Polygon& polygon : AllPolygons()[static_cast<std::size_t>(behind)]) {
    if (std::any_of(polygon.begin(), polygon.end(), is_steep)) continue;
    for (std::size_t i = 2; i < polygon.size(); ++i)
      triangles->push_back({{number(polygon[0]), number(polygon[i - 1]), number(polygon[i])}});
  }
}

std::vector<EdgeTriangle> TrianglesOf(const VoxelBlocks& blocks, int block, int min_frames) {
  const BlockSurroundings around(blocks, block, min_frames);
  const float steepest = kSteepestVoxels * static_cast<float>(blocks.voxel_m());
  std::vector<EdgeTriangle> triangles;
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y) {
      for (int x = 0; x < kBlockSide; ++x) Triangulate(around, x, y, z, steepest, &triangles);
    }
  }
  return triangles;
}

// Where the distance is 0 on an edge, by linear interpolation, and the colour there.
void SetVertex(const VoxelBlocks& blocks, EdgeNumber edge, std::size_t i, PointCloud* vertices) {
  const int axis = static_cast<int>(edge % 3), in_block = static_cast<int>(edge / 3 % kBlockVoxels);
  const int block = static_cast<int>(edge / 3 / kBlockVoxels);
  const Eigen::Vector3i from =
      kBlockSide * blocks.corner(block) + Eigen::Vector3i(in_block & 7, in_block >> 3 & 7, in_block >> 6);
  const Voxel& a = blocks.block(block)[static_cast<std::size_t>(in_block)];
  const Voxel& b = *blocks.At(from + Eigen::Vector3i::Unit(axis));
  const float share = a.distance / (a.distance - b.distance);
  Eigen::Vector3d at = from.cast<double>();
  at[axis] += static_cast<double>(share);
  vertices->points[i] = (blocks.voxel_m() * at).cast<float>();
  const std::array<std::uint16_t, 3> none = {};
  for (std::size_t c = 0; c < 3; ++c) {
    float grey = 128 * 256;
    if (a.bgr != none || b.bgr != none) {
      const float first = static_cast<float>((a.bgr != none ? a : b).bgr[c]);
      grey = first + share * (static_cast<float>((b.bgr != none ? b : a).bgr[c]) - first);
    }
    vertices->colours[i][2 - c] = static_cast<std::uint8_t>(std::min(grey / 256 + 0.5F, 255.0F));
  }
}

// The mean of the triangles around each vertex, by their areas.
void SetNormals(TriangleMesh* mesh) {
  PointCloud& vertices = mesh->vertices;
  vertices.normals.assign(vertices.points.size(), Eigen::Vector3f::Zero());
  for (const auto& [a, b, c] : mesh->triangles) {
    const Eigen::Vector3f& corner = vertices.points[a];
    const Eigen::Vector3f normal = (vertices.points[b] - corner).cross(vertices.points[c] - corner);
    for (const std::uint32_t vertex : {a, b, c}) vertices.normals[vertex] += normal;
  }
  for (Eigen::Vector3f& normal : vertices.normals) {
    const float length = normal.norm();
    normal = length > 0 ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
  }
}

}  // namespace

VoxelMesh MarchingCubes(const VoxelBlocks& blocks, int min_frames, int threads) {
  std::vector<std::vector<EdgeTriangle>> of_blocks(static_cast<std::size_t>(blocks.Count()));
  RunParallel(blocks.Count(), threads, [&](int block) {
    of_blocks[static_cast<std::size_t>(block)] = TrianglesOf(blocks, block, min_frames);
  });
  std::vector<EdgeNumber> edges;
  for (const std::vector<EdgeTriangle>& triangles : of_blocks) {
    for (const EdgeTriangle& triangle : triangles)
      edges.insert(edges.end(), triangle.begin(), triangle.end());
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());

  VoxelMesh out;
  out.voxels.resize(edges.size());
  out.mesh.vertices.points.resize(edges.size());
  out.mesh.vertices.colours.resize(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    out.voxels[i] = edges[i] / 3;
    SetVertex(blocks, edges[i], i, &out.mesh.vertices);
  }
  const auto vertex = [&edges](EdgeNumber edge) {
    return static_cast<std::uint32_t>(std::lower_bound(edges.begin(), edges.end(), edge) - edges.begin());
  };
  for (const std::vector<EdgeTriangle>& triangles : of_blocks) {
    for (const auto& [a, b, c] : triangles) out.mesh.triangles.push_back({{vertex(a), vertex(b), vertex(c)}});
  }
  SetNormals(&out.mesh);
  return out;
}

VoxelMesh WithoutSpecks(const VoxelMesh& whole, std::size_t least) {
  const PointCloud& vertices = whole.mesh.vertices;
  // Union-find: each vertex leads to one of its piece that has a smaller number.
  std::vector<std::uint32_t> leads(vertices.points.size());
  std::iota(leads.begin(), leads.end(), 0U);
  const auto root = [&leads](std::uint32_t i) {
    while (leads[i] != i) i = leads[i] = leads[leads[i]];
    return i;
  };
  for (const auto& [a, b, c] : whole.mesh.triangles) {
    for (const std::uint32_t other : {b, c}) {
      const std::uint32_t one = root(a), two = root(other);
      leads[std::max(one, two)] = std::min(one, two);
    }
  }
  std::vector<std::size_t> sizes(leads.size(), 0);
  for (const auto& triangle : whole.mesh.triangles) ++sizes[root(triangle[0])];

  VoxelMesh out;
  std::vector<std::uint32_t> numbers(leads.size(), 0);
  for (std::uint32_t i = 0; i < leads.size(); ++i) {
    if (sizes[root(i)] < least) continue;
    numbers[i] = static_cast<std::uint32_t>(out.voxels.size());
    out.voxels.push_back(whole.voxels[i]);
    out.mesh.vertices.points.push_back(vertices.points[i]);
    out.mesh.vertices.normals.push_back(vertices.normals[i]);
    out.mesh.vertices.colours.push_back(vertices.colours[i]);
  }
  for (const auto& [a, b, c] : whole.mesh.triangles) {
    if (sizes[root(a)] >= least) out.mesh.triangles.push_back({{numbers[a], numbers[b], numbers[c]}});
  }
  return out;
}

}  // namespace tutti
