// Depth images that lie in a folder of their own, for images that have none.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frontend/dataset/depth_reader.h"
#include "frontend/features/rectifier.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// One camera's images with registered depth: an RGB-D data set.
class DepthBeside : public Dataset {
 public:
  /// `stamps`: of all images of `folder_of_images`, whatever part of them `images` has. Depth images are
  /// paired in the order of their names if there are as many, else by the stamps that they are called by
  /// (max_association_s). Throws InputError if neither works.
  DepthBeside(std::unique_ptr<Dataset> images, const std::vector<double>& stamps,
              const std::filesystem::path& depth, const DatasetOptions& options);

  Supply FrameSupply() const override { return images_->FrameSupply(); }
  std::size_t Size() const override { return images_->Size(); }
  double Stamp(std::size_t i) const override { return images_->Stamp(i); }
  std::int64_t Number(std::size_t i) const override { return images_->Number(i); }
  /// With depth, or with depth_error.
  ReadResult Read(std::size_t i) const override;
  ColourImage ReadColour(std::size_t i) const override { return images_->ReadColour(i); }
  double SkippedShare() const override { return images_->SkippedShare(); }
  const CameraRig& Rig() const override { return rig_; }
  std::optional<std::filesystem::path> GroundTruthFile() const override { return images_->GroundTruthFile(); }
  Trajectory ReadGroundTruth(const std::filesystem::path& file,
                             std::vector<std::string>* warnings) const override {
    return images_->ReadGroundTruth(file, warnings);
  }
  const std::vector<std::string>& Warnings() const override { return warnings_; }

 private:
  std::unique_ptr<Dataset> images_;
  DatasetOptions options_;
  CameraRig rig_;
  std::optional<Rectifier> rectifier_;  // of a camera with distortion
  std::optional<DepthReader> reader_;
  std::vector<std::filesystem::path> files_;  // of each image; empty: none
  std::vector<std::string> warnings_;
};

}  // namespace tutti
