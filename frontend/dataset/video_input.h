// What video files and live cameras share: opening, grey frames, the mask of all images.
#pragma once

#include <opencv2/videoio.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frontend/features/rectifier.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// Opens a video file with FFmpeg or OpenCV's own decoder. Throws InputError.
void OpenVideoFile(const std::filesystem::path& file, cv::VideoCapture& capture);

/// Opens a stream by its address (rtsp://, http://) with FFmpeg or GStreamer. Throws InputError.
void OpenVideoStream(const std::string& address, cv::VideoCapture& capture);

/// The next frame in grey (8 bit); false at the end, and where it can't be decoded.
bool ReadGreyFrame(cv::VideoCapture& capture, cv::Mat& grey);
/// The same of the frame that was grabbed last.
bool RetrieveGreyFrame(cv::VideoCapture& capture, cv::Mat& grey);
/// The same in colour, 3 channels, blue first.
bool ReadColourFrame(cv::VideoCapture& capture, cv::Mat& colour);

/// options.mask, which must be one for all images, rectified; empty if there is none. Throws InputError.
cv::Mat MaskOfAll(const DatasetOptions& options, cv::Size size, const std::optional<Rectifier>& rectifier);

}  // namespace tutti
