#include "frontend/dataset/video_decoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libswscale/swscale.h>
}

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "frontend/dataset/rectified_rig.h"
#include "frontend/dataset/wrapped_dataset.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kPatience(30);  // with a stream that gives nothing
constexpr int kMostUndecodable = 1000;         // of a decoder in a row, without another packet
constexpr double kSloppy = 0.5;                // times go back by less without being another recording's [s]

int IsOverdue(void* deadline) { return Clock::now() > *static_cast<Clock::time_point*>(deadline) ? 1 : 0; }

// The display matrix of the stream; null: none.
const std::int32_t* DisplayMatrix(const AVStream& stream) {
#if LIBAVFORMAT_VERSION_INT < AV_VERSION_INT(60, 15, 100)
  return reinterpret_cast<const std::int32_t*>(
      av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr));
#else
  const AVPacketSideData* const found = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  return found != nullptr ? reinterpret_cast<const std::int32_t*>(found->data) : nullptr;
#endif
}

// How far the principal point is from the middle of images of this size, as share of their sides.
double OffCentre(const PinholeCamera& camera, cv::Size size) {
  return std::max(std::abs((camera.cx + 0.5) / size.width - 0.5),
                  std::abs((camera.cy + 0.5) / size.height - 0.5));
}

// Whether the camera is that of the sensor's `own` orientation, and not of the images that are `turned`. One
// that has the size of its images from these, or none, is told by its principal point.
bool IsOfSensor(const PinholeCamera& camera, cv::Size own, cv::Size turned) {
  const cv::Size size(camera.width, camera.height);
  if (size != own && size != turned && size != cv::Size()) return false;  // of neither, which is said later
  if (own == turned || size == own) return true;
  return OffCentre(camera, turned) > 0.1 && OffCentre(camera, own) < OffCentre(camera, turned);
}

// The pixels become so many times as wide.
PinholeCamera Widened(PinholeCamera camera, double aspect, int width) {
  camera.fx /= aspect;
  camera.cx = (camera.cx + 0.5) / aspect - 0.5;
  camera.width = width;
  return camera;
}

}  // namespace

struct VideoDecoder::Parts {
  template <auto Free>
  struct Freed {
    template <class T>
    void operator()(T* made) const {
      Free(&made);
    }
  };
  struct FreedScaler {
    void operator()(SwsContext* made) const { sws_freeContext(made); }
  };

  std::string source;
  Clock::time_point deadline = Clock::time_point::max();  // of a stream
  std::unique_ptr<AVFormatContext, Freed<avformat_close_input>> format;
  std::unique_ptr<AVCodecContext, Freed<avcodec_free_context>> codec;
  std::unique_ptr<AVPacket, Freed<av_packet_free>> packet;
  std::unique_ptr<AVFrame, Freed<av_frame_free>> frame;
  std::unique_ptr<SwsContext, FreedScaler> scaler;
  AVStream* stream = nullptr;
  bool flushing = false;

  void Open();
  void OpenCodec(const AVCodec* decoder);
  bool NextPacket();
  bool Interlaced() const { return stream->codecpar->field_order > AV_FIELD_PROGRESSIVE; }
};

void VideoDecoder::Parts::Open() {
  if (source == "-" && isatty(STDIN_FILENO) != 0)
    throw InputError(
        "-: standard input is the terminal; send it a video: ffmpeg ... -f matroska - | tutti ...");
  av_log_set_level(AV_LOG_QUIET);  // what is damaged is said by who asks for it
  AVFormatContext* made = avformat_alloc_context();
  if (made == nullptr) throw std::bad_alloc();
  AVDictionary* options = nullptr;
  std::string address = "file:" + source;  // a colon in a file's name is none of a protocol
  if (source == "-") address = IsPipe(source) ? "pipe:0" : "file:/dev/stdin";
  if (IsStream(source)) {
    address = source;
    av_dict_set(&options, "rtsp_transport", "tcp", 0);
    deadline = Clock::now() + kPatience;
    made->interrupt_callback = {IsOverdue, &deadline};
  }
  const int code = avformat_open_input(&made, address.c_str(), nullptr, &options);  // frees it where it fails
  av_dict_free(&options);
  format.reset(code < 0 ? nullptr : made);
  const AVCodec* decoder = nullptr;
  if (code >= 0 && avformat_find_stream_info(made, nullptr) >= 0) {
    const int at = av_find_best_stream(made, AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (at >= 0) stream = made->streams[at];
  }
  if (stream != nullptr) OpenCodec(decoder);
  if (codec != nullptr) return;
  if (IsStream(source))
    throw InputError(source +
                     ": no stream of video can be opened there; check the address, the network, and whether "
                     "a video player shows it");
  if (IsPipe(source))
    throw InputError(source +
                     ": what comes through the pipe can't be read as a video; send one whose end need not be "
                     "there: ffmpeg -i INPUT -c copy -f matroska - | tutti ...");
  throw InputError(source +
                   ": can't be opened as a video; is it complete and of a format that FFmpeg decodes?");
}

void VideoDecoder::Parts::OpenCodec(const AVCodec* decoder) {
  for (unsigned i = 0; i < format->nb_streams; ++i) {
    if (format->streams[i] != stream) format->streams[i]->discard = AVDISCARD_ALL;
  }
  decltype(codec) made(avcodec_alloc_context3(decoder));
  if (made == nullptr || avcodec_parameters_to_context(made.get(), stream->codecpar) < 0) return;
  made->pkt_timebase = stream->time_base;
  made->thread_count = cv::getNumberOfCPUs();
  made->max_pixels = static_cast<std::int64_t>(kMostImagePixels);
  if (avcodec_open2(made.get(), decoder, nullptr) < 0) return;
  packet.reset(av_packet_alloc());
  frame.reset(av_frame_alloc());
  codec = std::move(made);
}

// The next packet of the video; false at the end.
bool VideoDecoder::Parts::NextPacket() {
  if (IsStream(source)) deadline = Clock::now() + kPatience;
  while (true) {
    av_packet_unref(packet.get());
    const int code = av_read_frame(format.get(), packet.get());
    if (code == AVERROR(EAGAIN)) continue;
    if (code < 0) return false;
    if (packet->stream_index == stream->index) return true;
  }
}

VideoDecoder::VideoDecoder(const std::string& source) : parts_(std::make_unique<Parts>()) {
  parts_->source = source;
  parts_->Open();
}

VideoDecoder::~VideoDecoder() = default;
VideoDecoder::VideoDecoder(VideoDecoder&&) noexcept = default;
VideoDecoder& VideoDecoder::operator=(VideoDecoder&&) noexcept = default;

bool VideoDecoder::Grab() {
  int failures = 0;  // damaged frames, and those before the first whole one
  while (true) {
    const int code = avcodec_receive_frame(parts_->codec.get(), parts_->frame.get());
    if (code >= 0) return true;
    if (code == AVERROR_EOF) return false;
    if (code != AVERROR(EAGAIN) && ++failures < kMostUndecodable) continue;
    if (parts_->flushing) return false;
    parts_->flushing = !parts_->NextPacket();
    avcodec_send_packet(parts_->codec.get(), parts_->flushing ? nullptr : parts_->packet.get());
  }
}

std::optional<std::int64_t> VideoDecoder::Ticks() const {
  const std::int64_t ticks = parts_->frame->best_effort_timestamp;
  if (ticks == AV_NOPTS_VALUE) return std::nullopt;
  return ticks;
}

double VideoDecoder::Seconds(std::int64_t ticks) const {
  const AVRational unit = parts_->stream->time_base;
  return static_cast<double>(ticks) * unit.num / unit.den;
}

cv::Mat VideoDecoder::Retrieve(Pixels pixels) const {
  const AVFrame& frame = *parts_->frame;
  const auto format = static_cast<AVPixelFormat>(frame.format);
  if (frame.data[0] == nullptr || frame.width <= 0 || frame.height <= 0) return {};
  const cv::Size size(frame.width, frame.height);
  if (pixels == Pixels::kStored) {
    const int type = format == AV_PIX_FMT_GRAY16LE ? CV_16UC1 : format == AV_PIX_FMT_GRAY8 ? CV_8UC1 : -1;
    if (type < 0 || frame.linesize[0] <= 0) return {};
    return TurnedImage(
        cv::Mat(size, type, frame.data[0], static_cast<std::size_t>(frame.linesize[0])).clone(), TurnedBy());
  }
  // By way of the colours, as OpenCV does, and as images are read that are files.
  parts_->scaler.reset(sws_getCachedContext(parts_->scaler.release(), size.width, size.height, format,
                                            size.width, size.height, AV_PIX_FMT_BGR24, SWS_BICUBIC, nullptr,
                                            nullptr, nullptr));
  if (parts_->scaler == nullptr) return {};
  // The scaler writes up to 32 bytes at once, also beyond the end of a row.
  cv::Mat padded(size.height, size.width + 32, CV_8UC3);
  std::uint8_t* const rows[] = {padded.data, nullptr, nullptr, nullptr};
  const int steps[] = {static_cast<int>(padded.step), 0, 0, 0};
  if (sws_scale(parts_->scaler.get(), frame.data, frame.linesize, 0, size.height, rows, steps) <= 0)
    return {};
  cv::Mat image = padded.colRange(0, size.width);
  if (pixels == Pixels::kColour) return TurnedImage(image.clone(), TurnedBy());
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return TurnedImage(grey, TurnedBy());
}

double VideoDecoder::RateHz() const {
  const AVRational rate = parts_->stream->avg_frame_rate;
  return rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 0;
}

int VideoDecoder::TurnedBy() const {
  const std::int32_t* const matrix = DisplayMatrix(*parts_->stream);
  if (matrix == nullptr) return 0;
  const double degrees = -av_display_rotation_get(matrix);  // counter-clockwise, nan for none
  if (!std::isfinite(degrees)) return 0;
  return (static_cast<int>(std::lround(degrees / 90)) % 4 + 4) % 4 * 90;
}

double VideoDecoder::PixelAspect() const {
  const AVRational aspect = av_guess_sample_aspect_ratio(parts_->format.get(), parts_->stream, nullptr);
  if (aspect.num <= 0 || aspect.den <= 0) return 1;
  const double ratio = av_q2d(aspect);
  return std::abs(ratio - 1) < 0.005 ? 1 : ratio;  // encoders round the shape of the whole image
}

VideoDecoder::Listed VideoDecoder::List() {
  Listed out;
  bool shown = !parts_->Interlaced(), decoded = true;
  while (parts_->NextPacket()) {
    const AVPacket& packet = *parts_->packet;
    if (packet.size == 0 || (packet.flags & AV_PKT_FLAG_DISCARD) != 0) continue;  // shows nothing new
    const std::size_t at = out.decoded.size();
    decoded = decoded && packet.dts != AV_NOPTS_VALUE;
    if (decoded && at > 0 && Seconds(out.decoded.back() - packet.dts) > kSloppy)
      throw InputError(StampsJumpBack(parts_->source, at, Seconds(out.decoded.back()), Seconds(packet.dts)));
    shown = shown && packet.pts != AV_NOPTS_VALUE && (packet.flags & AV_PKT_FLAG_CORRUPT) == 0;
    out.shown.push_back(packet.pts);
    out.decoded.push_back(packet.dts);
  }
  if (!shown) out.shown.clear();
  if (!decoded) out.decoded.clear();
  std::sort(out.shown.begin(), out.shown.end());
  return out;
}

std::optional<PinholeCamera> CameraOfVideo(const std::string& name, const VideoDecoder& video,
                                           const DatasetOptions& options, cv::Size size,
                                           std::vector<std::string>& warnings) {
  const int degrees = video.TurnedBy();
  const double aspect = video.PixelAspect();
  const bool quarter = degrees % 180 != 0;
  const cv::Size own = quarter ? cv::Size(size.height, size.width) : size;
  const int square_width = static_cast<int>(std::lround(own.width * aspect));
  if (degrees != 0 && options.sensor != Sensor::kMono)
    throw InputError(name + ": its rotation flag says " + std::to_string(degrees) +
                     " deg, and images of two cameras can't be turned; remove the flag (ffmpeg -i INPUT -c "
                     "copy -metadata:s:v rotate=0 OUTPUT), or use one camera (sensor mono)");
  if (degrees != 0 && options.readout_s > 0)
    throw InputError(name + ": its rotation flag says " + std::to_string(degrees) +
                     " deg, and images of a rolling shutter can't be turned: its rows would become columns, "
                     "or run upwards; leave readout_s 0");
  std::optional<PinholeCamera> camera = options.camera;
  std::string pixels = name + ": its pixels are " + std::to_string(aspect) + " times as wide as high";
  if (!camera && options.fov_deg > 0) {
    camera = CameraOfView(options.fov_deg, own);
    camera->fy *= aspect;
  } else if (camera && aspect != 1) {
    const bool square = cv::Size(camera->width, camera->height) == cv::Size(square_width, own.height);
    if (square) camera = Widened(*camera, aspect, own.width);
    pixels += square ? "; the calibration, of square ones, is made that of " + SizeText(own)
                     : "; the calibration must be of images as they are stored, " + SizeText(own);
  }
  if (aspect != 1) warnings.push_back(pixels);
  if (degrees == 0) return camera;
  std::string turned = name + ": its rotation flag says " + std::to_string(degrees) +
                       " deg: the images are turned clockwise by that, to " + SizeText(size);
  if (camera && IsOfSensor(*camera, own, size)) {
    camera->width = own.width;
    camera->height = own.height;
    camera = TurnedCamera(*camera, degrees);
    turned += ", and with them the camera, as one of the sensor's own orientation (" + SizeText(own) + ")";
  }
  warnings.push_back(turned);
  return camera;
}

std::string StampsJumpBack(const std::string& name, std::size_t at, double before_s, double stamp_s) {
  return name + ": its time stamps jump back at image " + std::to_string(at) + ", from " +
         std::to_string(before_s) + " s to " + std::to_string(stamp_s) +
         " s: it is two recordings, or its clock was set; cut it there, and run each part";
}

}  // namespace tutti
