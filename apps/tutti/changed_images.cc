#include "apps/tutti/changed_images.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "apps/tutti/files.h"
#include "apps/tutti/loops/loops_input.h"
#include "core/replaced_file.h"
#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

// `stems`: of all images in `from`, which an earlier call has written from.
void Prepare(const fs::path& from, const fs::path& out, const std::set<std::string>& stems, bool force) {
  std::error_code error;
  if (fs::equivalent(from, out, error)) {
    throw InputError(out.string() + ": holds the images that are read; give another folder");
  }
  if (fs::exists(out, error) && !fs::is_directory(out, error)) {
    throw InputError(out.string() + ": is a file; give a folder");
  }
  if (fs::exists(out, error) && !fs::is_empty(out, error)) {
    if (!force)
      throw InputError(out.string() + ": is not empty; give another folder, or --force to write into it");
    const std::vector<fs::path> old = ImagesIn(out);
    for (const fs::path& image : old) {
      if (stems.count(image.stem().string()) > 0) continue;
      throw InputError(image.string() + ": was not made from an image in " + from.string() +
                       ", so --force leaves it alone; move it, or give another folder");
    }
    for (const fs::path& image : old) fs::remove(image, error);
  }
  MakeFolder(out);
}

// An image with three channels that are all the same is grey (webp has no grey of its own).
cv::Mat GreyIfColourless(const cv::Mat& image) {
  if (image.channels() != 3) return image;
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  const bool grey = cv::norm(channels[0], channels[1], cv::NORM_INF) == 0 &&
                    cv::norm(channels[0], channels[2], cv::NORM_INF) == 0;
  return grey ? channels[0] : image;
}

class Writer {
 public:
  Writer(const ImageChange& change, const ChangedImagesOptions& options)
      : change_(change), options_(options) {
    const std::vector<fs::path> all = ListImages(options.from, true, &notes_);
    for (const fs::path& image : all) all_stems_.insert(image.stem().string());
    for (std::size_t i = 0; i < all.size(); i += static_cast<std::size_t>(options.stride))
      images_.push_back(all[i]);
    FindRange();
    std::set<std::string> stems;
    for (const fs::path& image : images_) {
      if (!stems.insert(image.stem().string()).second) {
        throw InputError(image.string() +
                         ": another image of the folder has this name with another ending; "
                         "all are written as png, so rename one");
      }
    }
  }

  ChangedImages Run() {
    Prepare(options_.from, options_.out, all_stems_, options_.force);
    std::vector<std::thread> threads;
    try {
      for (int k = 1; k < options_.threads; ++k) threads.emplace_back([this] { Work(); });
    } catch (const std::system_error&) {  // the system has no more: those that are there do all
    }
    Work();
    for (std::thread& thread : threads) thread.join();
    if (failure_) std::rethrow_exception(failure_);
    return {images_.size(), next_, notes_};
  }

 private:
  // Takes images in order until all are taken or one thread stopped: then those taken so far are complete.
  void Work() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stop_ && next_ < images_.size()) {
      const std::size_t i = next_++;
      lock.unlock();
      std::exception_ptr failure;
      try {
        WriteOne(i);
      } catch (...) {
        failure = std::current_exception();
      }
      lock.lock();
      ++done_;
      if (failure) {
        failure_ = failure_ ? failure_ : failure;
        stop_ = true;
      } else if (options_.progress && !options_.progress(done_, images_.size())) {
        stop_ = true;
      }
    }
  }

  // OpenCV makes 8 bit of 16 by leaving out the lower ones, where all is that a thermal camera sees.
  void FindRange() {
    constexpr std::size_t kLooked = 8;
    std::vector<cv::Mat> greys;
    for (std::size_t k = 0; k < std::min(kLooked, images_.size()); ++k) {
      const ImageFile read = ReadGreyFile(images_[k * images_.size() / kLooked]);
      if (k == 0 && read.image.depth() != CV_16U) return;
      greys.push_back(read.image);
    }
    range_ = RangeOf(greys);
    if (range_.narrow) notes_.push_back(options_.from.string() + ": " + RangeText(range_));
  }
  cv::Mat Stretched(const fs::path& file) const {
    const ImageFile read = ReadGreyFile(file);
    if (!read.error.empty()) throw InputError(read.error);
    return To8Bit(read.image, range_);
  }

  void WriteOne(std::size_t i) const {
    const fs::path& from = images_[i];
    if (static_cast<int>(i) < options_.change_from) {
      std::error_code error;
      internal::ReplacedFile copy(options_.out / from.filename());
      fs::copy_file(from, copy.part(), fs::copy_options::overwrite_existing, error);
      if (!error) return copy.Commit();
      throw InputError(from.string() + ": can't be copied (" + error.message() + ")");
    }
    const ImageFile read = ReadImageFile(from, cv::IMREAD_ANYCOLOR);
    if (!read.error.empty()) throw InputError(read.error);
    const cv::Mat image = range_.narrow ? Stretched(from) : read.image;
    const fs::path to = options_.out / (from.stem().string() + ".png");
    const cv::Mat changed = change_.Apply(GreyIfColourless(image), options_.seed, static_cast<int>(i));
    WritePngFile(to, changed, {cv::IMWRITE_PNG_COMPRESSION, 1});
  }

  const ImageChange& change_;
  const ChangedImagesOptions& options_;
  std::vector<fs::path> images_;
  std::vector<std::string> notes_;
  GreyRange range_;
  std::set<std::string> all_stems_;  // with those that the stride leaves out
  std::mutex mutex_;                 // of what follows
  std::size_t next_ = 0, done_ = 0;
  bool stop_ = false;
  std::exception_ptr failure_;
};

}  // namespace

ChangedImages WriteChangedImages(const ImageChange& change, const ChangedImagesOptions& options) {
  return Writer(change, options).Run();
}

}  // namespace tutti::cli
