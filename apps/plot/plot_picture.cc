#include "apps/plot/plot_picture.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "core/replaced_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

struct CairoDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* page) const { cairo_destroy(page); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};
using Surface = std::unique_ptr<cairo_surface_t, CairoDeleter>;
using Page = std::unique_ptr<cairo_t, CairoDeleter>;

// Texts are as wide on every surface: no hinting.
Page PageOn(const Surface& surface, const PlotFont& font) {
  Page page(cairo_create(surface.get()));
  const std::unique_ptr<cairo_font_options_t, CairoDeleter> options(cairo_font_options_create());
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
  cairo_set_font_options(page.get(), options.get());
  cairo_select_font_face(page.get(), font.family.c_str(), CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  return page;
}

// Cairo stops at what is not UTF-8; a file's name may be.
std::string Drawable(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const std::size_t length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    bool good = length > 0 && first < 0xF5 && i + length <= text.size();
    for (std::size_t k = 1; good && k < length; ++k) good = (text[i + k] & 0xC0) == 0x80;
    if (good) {
      out.append(text, i, length);
      i += length;
    } else {
      out += '?';
      ++i;
    }
  }
  return out;
}

double WidthOf(cairo_t* page, const std::string& text, double height) {
  cairo_set_font_size(page, height);
  cairo_text_extents_t extents;
  cairo_text_extents(page, text.c_str(), &extents);
  return extents.x_advance;
}

void DrawText(cairo_t* page, const PlotShape& shape, double scale) {
  const std::string text = Drawable(shape.text);
  const double width = WidthOf(page, text, scale * shape.size);
  const double shift = shape.anchor == PlotShape::Anchor::kStart    ? 0.0
                       : shape.anchor == PlotShape::Anchor::kMiddle ? 0.5 * width
                                                                    : width;
  cairo_save(page);
  cairo_translate(page, shape.points[0].x(), shape.points[0].y());
  if (shape.vertical) cairo_rotate(page, -0.5 * M_PI);
  cairo_move_to(page, -shift, 0);
  cairo_show_text(page, text.c_str());
  cairo_restore(page);
}

// Dashes run on over the corners of a polyline.
void DrawLine(cairo_t* page, const PlotShape& shape) {
  static constexpr double kDash[] = {7, 5};
  cairo_set_line_width(page, shape.size);
  cairo_set_line_join(page, CAIRO_LINE_JOIN_ROUND);
  cairo_set_dash(page, kDash, shape.dashed ? 2 : 0, 0);
  for (const Eigen::Vector2d& p : shape.points) cairo_line_to(page, p.x(), p.y());
  cairo_stroke(page);
}

void Draw(cairo_t* page, const PlotShape& shape, double text_scale) {
  const cv::Scalar bgr = PlotColor(shape.color);
  cairo_set_source_rgb(page, bgr[2] / 255, bgr[1] / 255, bgr[0] / 255);
  const Eigen::Vector2d& p = shape.points[0];
  cairo_new_path(page);  // a text leaves a current point
  if (shape.kind == PlotShape::Kind::kLine) return DrawLine(page, shape);
  if (shape.kind == PlotShape::Kind::kText) return DrawText(page, shape, text_scale);
  if (shape.kind == PlotShape::Kind::kDisc) {
    cairo_arc(page, p.x(), p.y(), shape.size, 0, 2 * M_PI);
  } else {
    const Eigen::Vector2d size = shape.points[1] - p;
    cairo_rectangle(page, p.x(), p.y(), size.x(), size.y());
  }
  cairo_fill(page);
}

void DrawPage(const Surface& surface, const std::vector<PlotShape>& shapes, const PlotFont& font) {
  const Page page = PageOn(surface, font);
  cairo_set_source_rgb(page.get(), 1, 1, 1);
  cairo_paint(page.get());
  for (const PlotShape& shape : shapes) Draw(page.get(), shape, font.scale);
  cairo_show_page(page.get());
}

void Check(const std::filesystem::path& file, cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw InputError(file.string() + ": can't be drawn (" + cairo_status_to_string(status) + ")");
}

// What Cairo writes, as a text.
cairo_status_t Append(void* text, const unsigned char* bytes, unsigned length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), length);
  return CAIRO_STATUS_SUCCESS;
}

std::string Escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const char* const name = c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : nullptr;
    out += name != nullptr ? name : std::string(1, static_cast<unsigned char>(c) < 0x20 ? ' ' : c);
  }
  return out;
}

// Texts are outlines: for search and screen readers they stand here as well.
std::string Description(const std::vector<PlotShape>& shapes) {
  std::string text = "\n<desc>\n";
  for (const PlotShape& shape : shapes) {
    if (!shape.text.empty()) text += Escaped(Drawable(shape.text)) + "\n";
  }
  return text + "</desc>";
}

// Cairo numbers its surfaces through the life of the process: the same plot would have other bytes next time.
std::string FinishedSvg(std::string text, const std::vector<PlotShape>& shapes) {
  const std::string number = "<g id=\"surface";
  const std::size_t at = text.find(number);
  if (at != std::string::npos) text.replace(at, text.find('>', at) - at, "<g");
  return text.insert(text.find('>', text.find("<svg")) + 1, Description(shapes));
}

void WriteSurface(const std::filesystem::path& file, const Surface& surface) {
  std::string bytes;
  Check(file, cairo_surface_write_to_png_stream(surface.get(), Append, &bytes));
  internal::WriteFile(file, bytes);
}

Surface PixelsOf(int width, int height) {
  return Surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
}

// Rows of the surface, whose pixels have a fourth byte that nobody reads.
cv::Mat Pixels(const Surface& surface) {
  return {cairo_image_surface_get_height(surface.get()), cairo_image_surface_get_width(surface.get()),
          CV_8UC4, cairo_image_surface_get_data(surface.get()),
          static_cast<std::size_t>(cairo_image_surface_get_stride(surface.get()))};
}

// Blue, green and red, whatever comes behind them.
void CopyColours(const cv::Mat& from, cv::Mat& to) {
  constexpr int kChannels[] = {0, 0, 1, 1, 2, 2};
  cv::mixChannels(&from, 1, &to, 1, kChannels, 3);
}

Surface CopyOf(const cv::Mat& picture) {
  Surface surface = PixelsOf(picture.cols, picture.rows);
  cv::Mat pixels = Pixels(surface);
  CopyColours(picture, pixels);
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

}  // namespace

cv::Scalar PlotColor(const std::string& hex) {
  unsigned value = 0;
  if (std::sscanf(hex.c_str(), "#%6x", &value) != 1) value = 0;
  return cv::Scalar(value & 0xff, (value >> 8) & 0xff, (value >> 16) & 0xff);
}

double TextWidth(const std::string& text, double height) {
  thread_local const Page page = PageOn(PixelsOf(1, 1), {});
  return WidthOf(page.get(), Drawable(text), height);
}

void DrawShapes(const std::vector<PlotShape>& shapes, cv::Mat& picture) {
  const Surface surface = CopyOf(picture);
  const Page page = PageOn(surface, {});
  for (const PlotShape& shape : shapes) Draw(page.get(), shape, 1);
  cairo_surface_flush(surface.get());
  CopyColours(Pixels(surface), picture);
}

void WritePicture(const std::filesystem::path& file, const cv::Mat& picture) {
  WriteSurface(file, CopyOf(picture));
}

PlotFormat PlotFormatOf(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".svg") return PlotFormat::kSvg;
  if (ending == ".png") return PlotFormat::kPng;
  if (ending == ".pdf") return PlotFormat::kPdf;
  throw InputError(file.string() + ": the name of a plot ends in .svg, .png or .pdf");
}

void WritePlot(const std::filesystem::path& file, PlotFormat format, const std::vector<PlotShape>& shapes,
               const PlotFont& font) {
  if (format == PlotFormat::kPng) {
    const Surface surface = PixelsOf(kPlotWidth, kPlotHeight);
    DrawPage(surface, shapes, font);
    WriteSurface(file, surface);
    return;
  }
  std::string bytes;
  const bool svg = format == PlotFormat::kSvg;
  const Surface surface(svg ? cairo_svg_surface_create_for_stream(Append, &bytes, kPlotWidth, kPlotHeight)
                            : cairo_pdf_surface_create_for_stream(Append, &bytes, kPlotWidth, kPlotHeight));
  if (svg) {
    cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
  } else {  // the same bytes from the same input: no time of day in the file
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  }
  DrawPage(surface, shapes, font);
  cairo_surface_finish(surface.get());
  Check(file, cairo_surface_status(surface.get()));
  internal::WriteFile(file, svg ? FinishedSvg(std::move(bytes), shapes) : bytes);
}

}  // namespace tutti
