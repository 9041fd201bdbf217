#include "data/synthetic/textures.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <string>

#include "data/synthetic/synthetic_random.h"

namespace tutti::synthetic {
namespace {

void Box(cv::Mat& image, double x, double y, double w, double h, double grey) {
  cv::rectangle(image, cv::Rect(cvRound(x), cvRound(y), std::max(1, cvRound(w)), std::max(1, cvRound(h))),
                cv::Scalar(std::clamp(grey, 0.0, 255.0)), cv::FILLED);
}

// Whole pixels of a length, rounded down.
int Share(int length, int parts, int of) { return length * parts / of; }

cv::Mat Plain(int width, int height, double grey) {
  return cv::Mat(height, width, CV_8UC1, cv::Scalar(grey));
}

void AddNoise(cv::Mat& image, int coarse, double amplitude, std::uint64_t seed) {
  cv::Mat sum;
  cv::add(image, Noise(image.cols, image.rows, coarse, amplitude, seed), sum, cv::noArray(), CV_32F);
  sum.convertTo(image, CV_8U);
}

// Courses of bricks, each brick of its own tone.
void Bricks(cv::Mat& image, int height, double contrast, Random& random) {
  const int width = height * 5 / 2;
  for (int y = 0, row = 0; y < image.rows; y += height, ++row) {
    for (int x = (row % 2) * -width / 2; x < image.cols; x += width) {
      const double tone = image.at<std::uint8_t>(0, 0) + random.In(-contrast, contrast);
      Box(image, x + 1, y + 1, width - 2, height - 2, tone);
    }
  }
}

// Faint stains and scratches.
void Marks(cv::Mat& image, int count, double contrast, Random& random) {
  for (int i = 0; i < count; ++i) {
    const int y = random.Int(0, image.rows - 1), x = random.Int(0, image.cols - 1);
    const cv::Point at(x, y);
    const cv::Scalar tone(image.at<std::uint8_t>(at) - random.In(0.4, 1) * contrast);
    if (random.Unit() < 0.5) {
      const double angle = random.In(0, 180);
      const int along = random.Int(3, 12), across = random.Int(2, 7);
      cv::ellipse(image, at, {along, across}, angle, 0, 360, tone, cv::FILLED);
    } else {
      const int thickness = random.Int(1, 2), dx = random.Int(-45, 45), dy = random.Int(-12, 12);
      cv::line(image, at, {x + dx, y + dy}, tone, thickness);
    }
  }
}

// Strokes that look like a line of writing.
void Writing(cv::Mat& image, const cv::Rect& where, double grey, Random& random) {
  std::string text;
  const int letters = random.Int(3, 7);
  for (int i = 0; i < letters; ++i) text += static_cast<char>('A' + random.Int(0, 25));
  int base = 0;
  const int font = random.Int(0, 1) != 0 ? cv::FONT_HERSHEY_DUPLEX : cv::FONT_HERSHEY_TRIPLEX;
  const cv::Size size = cv::getTextSize(text, font, 1.0, 2, &base);
  const double scale = std::min(0.85 * where.width / size.width, 0.75 * where.height / size.height);
  cv::putText(image, text, {where.x + where.width / 12, where.y + where.height * 5 / 6}, font, scale,
              cv::Scalar(grey), std::max(1, cvRound(2.5 * scale)), cv::LINE_8);
}

void Window(cv::Mat& image, const cv::Rect& r, double frame, int style, Random& random) {
  Box(image, r.x - 5, r.y - 5, r.width + 10, r.height + 10, frame);
  Box(image, r.x - 9, r.y + r.height + 5, r.width + 18, 6, frame * 0.7);  // sill
  const double glass = random.In(15, 75);
  for (int y = 0; y < r.height; ++y) {  // the sky's reflection fades downwards
    Box(image, r.x, r.y + y, r.width, 1, glass + 35.0 * (r.height - y) / r.height);
  }
  if (random.Unit() < 0.5) {  // curtains or blinds, drawn to some height
    const int drawn = random.Int(r.height / 5, r.height * 4 / 5);
    for (int y = 0; y < drawn; y += 4) Box(image, r.x, r.y + y, r.width, 2, random.In(110, 190));
  } else if (random.Unit() < 0.5) {  // something on the window sill
    const int w = random.Int(8, 18);
    const double tone = random.In(90, 220);
    Box(image, r.x + random.Int(2, r.width - w), r.y + r.height - 14, w, 14, tone);
  }
  const int bar = 3;
  if (style % 2 == 0) Box(image, r.x + Share(r.width, 1, 2) - Share(bar, 1, 2), r.y, bar, r.height, frame);
  if (style % 3 != 1) Box(image, r.x, r.y + Share(r.height, style == 2 ? 1 : 2, 4), r.width, bar, frame);
  if (style >= 3) {  // shutters
    const double tone = random.In(50, 90);
    for (const int x : {r.x - r.width / 2 - 5, r.x + r.width + 5}) {
      Box(image, x, r.y - 3, Share(r.width, 1, 2), r.height + 6, tone);
      for (int y = 4; y < r.height; y += 6)
        Box(image, x + 3, r.y + y, Share(r.width, 1, 2) - 6, 2, tone + 45);
    }
  }
}

}  // namespace

cv::Mat Noise(int width, int height, int coarse, double amplitude, std::uint64_t seed) {
  cv::Mat sum(height, width, CV_32FC1, cv::Scalar(0)), octave;  // once: under a sanitizer memory is costly
  Random random(seed ^ 0xA0153EULL);
  for (int wave = coarse; wave >= 2; wave /= 2) {
    cv::Mat grid(std::max(2, height / wave), std::max(2, width / wave), CV_32FC1);
    for (int y = 0; y < grid.rows; ++y) {
      for (int x = 0; x < grid.cols; ++x) grid.at<float>(y, x) = random.Normal();
    }
    cv::resize(grid, octave, sum.size(), 0, 0, cv::INTER_LINEAR);
    octave.convertTo(octave, CV_32F, amplitude * 0.5);
    sum += octave;
  }
  return sum;
}

cv::Mat WallTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(256, 256, random.In(85, 190));
  if (random.Unit() < 0.6) Bricks(image, random.Int(9, 14), 14, random);
  AddNoise(image, 64, 9, random.Bits());
  return image;
}

cv::Mat FacadeTexture(std::uint64_t seed) {
  Random random(seed);
  constexpr int kSide = 512;
  cv::Mat image = Plain(kSide, kSide, random.In(80, 195));
  if (random.Unit() < 0.5) Bricks(image, random.Int(8, 14), 12, random);
  AddNoise(image, 128, 7, random.Bits());
  const double roof = random.In(40, 110);
  Box(image, 0, 0, kSide, random.Int(10, 26), roof);
  const int floors = random.Int(2, 4), columns = random.Int(2, 5), style = random.Int(0, 4);
  const int pitch_y = (kSide - 40) / floors, pitch_x = kSide / columns;
  const double frame = random.In(0, 1) < 0.5 ? random.In(200, 250) : random.In(30, 80);
  const int w = std::min(pitch_x * 2 / 5, random.Int(50, 90)),
            h = std::min(pitch_y * 3 / 5, random.Int(70, 120));
  const bool shop = random.Unit() < 0.45;
  const int door = random.Int(0, columns - 1);
  for (int floor = 0; floor < floors; ++floor) {
    const int y = 34 + floor * pitch_y + (pitch_y - h) / 2 - 8;
    const bool ground = floor == floors - 1;
    if (!ground && random.Unit() < 0.6)
      Box(image, 0, 30 + (floor + 1) * pitch_y, kSide, 5, random.In(60, 220));
    for (int column = 0; column < columns; ++column) {
      const cv::Rect r(column * pitch_x + (pitch_x - w) / 2, y, w, h);
      if (ground && column == door) {
        const int door_h = std::min(150, kSide - y + 10);
        Box(image, r.x - 6, kSide - door_h - 6, w + 12, door_h + 6, frame);
        Box(image, r.x, kSide - door_h, w, door_h, random.In(25, 80));
        Box(image, r.x + 8, kSide - door_h + 10, w - 16, Share(door_h, 1, 3), random.In(90, 160));
        Box(image, r.x + w - 12, kSide - Share(door_h, 1, 2), 6, 6, 230);
      } else if (!(ground && shop) && random.Unit() < 0.93) {
        Window(image, r, frame, style, random);
      }
    }
  }
  if (shop) {
    const int top = kSide - pitch_y + 10;
    const int length = random.Int(260, 430);
    const cv::Rect board(random.Int(10, 60), top - 34, length, 40);
    Box(image, board.x, board.y, board.width, board.height, random.In(15, 60));
    Writing(image, board, 245, random);
    const int x0 = door * pitch_x + pitch_x / 2;
    for (int x = 16; x < kSide - 90; x += 100) {
      if (std::abs(x + 40 - x0) < 85) continue;
      Box(image, x, top + 14, 84, kSide - top - 44, frame);
      Box(image, x + 5, top + 19, 74, kSide - top - 54, random.In(20, 70));
      for (int i = 0; i < 6; ++i) {  // goods
        const double tone = random.In(80, 240);
        const int high = random.Int(8, 26), wide = random.Int(6, 18), y = random.Int(top + 24, kSide - 60);
        Box(image, x + random.Int(6, 60), y, wide, high, tone);
      }
    }
  }
  AddNoise(image, 16, 3, random.Bits());
  return image;
}

cv::Mat RoadTexture(std::uint64_t seed, bool crossing) {
  Random random(seed);
  constexpr int kSide = 512;
  cv::Mat image = Plain(kSide, kSide, random.In(82, 98));
  AddNoise(image, 64, 9, random.Bits());
  const int spots = random.Int(5, 9);
  for (int i = 0; i < spots; ++i) {  // repaired patches and stains
    const double tone = random.In(55, 125);
    const int height = random.Int(12, 70), width = random.Int(12, 60);
    const int y = random.Int(0, 440), x = random.Int(80, 380);
    Box(image, x, y, width, height, tone);
  }
  for (int i = 0; i < 10; ++i) {  // cracks
    const int y = random.Int(0, kSide - 1), x = random.Int(70, 440);
    cv::Point at(x, y);
    for (int k = 0; k < 8; ++k) {
      const int dy = random.Int(4, 22), dx = random.Int(-18, 18);
      const cv::Point next = at + cv::Point(dx, dy);
      cv::line(image, at, next, cv::Scalar(45), 2);
      at = next;
    }
  }
  if (!crossing) {
    for (int y = 20; y < kSide; y += 170) Box(image, Share(kSide, 1, 2) - 4, y, 8, 85, random.In(190, 225));
    for (const int x : {0, kSide - 64}) {  // pavements of slabs, and their curbs
      for (int y = 0; y < kSide; y += 32) {
        for (int k = 0; k < 2; ++k) Box(image, x + k * 32 + 1, y + 1, 30, 30, random.In(125, 165));
      }
      Box(image, x == 0 ? 60 : x, 0, 5, kSide, 185);
    }
  }
  const int cover_y = random.Int(40, 470), cover_x = random.Int(120, 390);
  const cv::Point cover(cover_x, cover_y);  // manhole
  cv::circle(image, cover, 13, cv::Scalar(48), cv::FILLED);
  cv::circle(image, cover, 9, cv::Scalar(105), 2);
  AddNoise(image, 8, 6, random.Bits());
  return image;
}

cv::Mat GroundTexture(std::uint64_t seed) {
  cv::Mat image = Plain(256, 256, 95);
  AddNoise(image, 64, 14, seed);
  return image;
}

cv::Mat SignTexture(std::uint64_t seed) {
  Random random(seed);
  const double back = random.Unit() < 0.5 ? random.In(180, 250) : random.In(10, 70);
  const double ink = back > 120 ? random.In(0, 70) : random.In(180, 255);
  cv::Mat image = Plain(128, 128, back);
  const int shapes = random.Int(4, 9);
  for (int i = 0; i < shapes; ++i) {
    const int y = random.Int(10, 118), x = random.Int(10, 118);
    const cv::Point at(x, y);
    const double tone = random.In(0, 255);
    if (random.Unit() < 0.4) {
      const int thickness = random.Unit() < 0.5 ? cv::FILLED : 4;
      cv::circle(image, at, random.Int(5, 24), cv::Scalar(tone), thickness);
    } else if (random.Unit() < 0.6) {
      const int height = random.Int(5, 30), width = random.Int(8, 50);
      Box(image, x - 10, y - 10, width, height, tone);
    } else {
      const int thickness = random.Int(2, 6), end_x = random.Int(0, 127), end_y = random.Int(0, 127);
      cv::line(image, at, {end_x, end_y}, cv::Scalar(tone), thickness);
    }
  }
  const int top = random.Int(4, 80), height = random.Int(26, 42);
  Writing(image, {4, top, 120, height}, ink, random);
  cv::rectangle(image, cv::Rect(0, 0, 128, 128), cv::Scalar(ink), 4);
  return image;
}

cv::Mat CarTexture(std::uint64_t seed, bool side) {
  Random random(seed);
  cv::Mat image = Plain(128, 64, random.In(40, 220));
  AddNoise(image, 32, 4, random.Bits());
  Box(image, side ? 20 : 12, 4, side ? 84 : 104, 22, 35);  // windows
  if (side) {
    Box(image, 58, 4, 4, 22, 120);
    Box(image, 60, 26, 2, 28, 20);
    for (const int x : {26, 102}) {
      cv::circle(image, {x, 52}, 12, cv::Scalar(15), cv::FILLED);
      cv::circle(image, {x, 52}, 6, cv::Scalar(150), cv::FILLED);
    }
    Box(image, 66, 32, 8, 3, 20);
  } else {
    for (const int x : {6, 104}) Box(image, x, 32, 18, 9, 240);
    Box(image, 42, 44, 44, 10, 235);
    Writing(image, {42, 44, 44, 11}, 10, random);
    Box(image, 0, 56, 128, 8, 25);
  }
  return image;
}

cv::Mat BusTexture(std::uint64_t seed) {
  Random random(seed);
  constexpr int kWidth = 512, kHeight = 256;
  cv::Mat image = Plain(kWidth, kHeight, random.In(50, 215));
  AddNoise(image, 128, 9, random.Bits());
  const bool windows = random.Unit() < 0.6;
  if (windows) {
    const int pitch = random.Int(58, 96), top = random.Int(20, 40), height = random.Int(60, 90);
    for (int x = 10; x + pitch - 8 < kWidth; x += pitch)
      Window(image, {x + 4, top, pitch - 14, height}, random.In(20, 50), 1, random);
  } else {  // planks of a lorry
    for (int x = 0; x < kWidth; x += 32) Box(image, x, 12, 2, 190, random.In(40, 120));
  }
  const int posters = random.Int(2, 4), low = windows ? 128 : 24;
  for (int k = 0; k < posters; ++k) {
    cv::Mat poster;
    const int height = random.Int(50, 80), width = random.Int(70, kWidth / posters - 24);
    const int y = low + random.Int(0, 12), x = k * kWidth / posters + random.Int(4, 20);
    const cv::Rect r(x, y, width, height);
    cv::resize(SignTexture(random.Bits()), poster, r.size(), 0, 0, cv::INTER_AREA);
    poster.copyTo(image(r));
  }
  Box(image, 0, 214, kWidth, 6, random.In(20, 230));
  Box(image, 0, 236, kWidth, 20, 28);
  for (const int x : {90, 420}) {
    cv::circle(image, {x, 226}, 28, cv::Scalar(14), cv::FILLED);
    cv::circle(image, {x, 226}, 13, cv::Scalar(145), cv::FILLED);
  }
  Marks(image, 25, 45, random);
  AddNoise(image, 16, 4, random.Bits());
  return image;
}

cv::Mat FoliageTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(128, 128, 70);
  for (int i = 0; i < 500; ++i) {
    const double tone = random.In(25, 135);
    const int radius = random.Int(2, 5), x = random.Int(0, 127), y = random.Int(0, 127);
    cv::circle(image, {x, y}, radius, cv::Scalar(tone), cv::FILLED);
  }
  return image;
}

cv::Mat SkyTexture(std::uint64_t seed) {
  cv::Mat image(256, 512, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) image.row(y).setTo(cv::Scalar(185 + 45.0 * y / image.rows));
  cv::Mat sum;
  cv::add(image, Noise(512, 256, 128, 7, seed), sum, cv::noArray(), CV_32F);
  cv::GaussianBlur(sum, sum, cv::Size(), 4);
  sum.convertTo(image, CV_8U);
  return image;
}

cv::Mat WoodTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(256, 256, 0);
  const double base = random.In(70, 170);
  const int plank = random.Int(28, 60);
  for (int x = 0; x < 256; x += plank) {
    for (int y = random.Int(-120, 0); y < 256; y += random.Int(80, 160))
      Box(image, x, y, plank, 256, base + random.In(-22, 22));
  }
  cv::Mat grain = Noise(256, 64, 32, 9, random.Bits()), sum;
  cv::resize(grain.t(), grain, image.size());
  cv::add(image, grain, sum, cv::noArray(), CV_32F);
  sum.convertTo(image, CV_8U);
  for (int x = 0; x < 256; x += plank) Box(image, x, 0, 2, 256, base - 45);
  for (int i = 0; i < 10; ++i) {
    const int radius = random.Int(2, 4), x = random.Int(0, 255), y = random.Int(0, 255);
    cv::circle(image, {x, y}, radius, cv::Scalar(base - 40), cv::FILLED);
  }
  return image;
}

cv::Mat ShelfTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(256, 256, 45);
  const int rows = random.Int(3, 5), pitch = 256 / rows;
  for (int row = 0; row < rows; ++row) {
    for (int x = 6; x < 236;) {
      const int w = random.Int(5, 16), h = random.Int(pitch / 2, pitch - 8);
      if (random.Unit() < 0.88) {
        const double tone = random.In(40, 235);
        Box(image, x, (row + 1) * pitch - 4 - h, w, h, tone);
        Box(image, x + 1, (row + 1) * pitch - 4 - Share(h, 3, 4), w - 2, random.Int(3, 9), 255 - tone);
      }
      x += w + 1;
    }
    Box(image, 0, (row + 1) * pitch - 4, 256, 4, 150);
  }
  Box(image, 0, 0, 5, 256, 150);
  Box(image, 251, 0, 5, 256, 150);
  return image;
}

cv::Mat PlasterTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(256, 256, 182);
  Marks(image, random.Int(3, 7), 22, random);
  if (random.Unit() < 0.4) {  // a socket or a switch
    const int x = random.Int(10, 230), y = random.Unit() < 0.6 ? 212 : 140;
    Box(image, x, y, 10, 10, 215);
    Box(image, x + 3, y + 3, 4, 4, 110);
  }
  AddNoise(image, 128, 2.5, random.Bits());
  Box(image, 0, 246, 256, 10, 95);  // skirting board
  return image;
}

cv::Mat CurtainTexture(std::uint64_t seed) {
  Random random(seed);
  const double grey = random.In(150, 200);
  cv::Mat folds = Noise(256, 4, 64, 12, random.Bits()).row(0), image;
  cv::GaussianBlur(folds, folds, {0, 0}, 6);
  cv::repeat(folds, 64, 1, image);
  image.convertTo(image, CV_8U, 1, grey);
  return image;
}

cv::Mat PaintTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(256, 256, random.In(170, 210));
  AddNoise(image, 128, 2.5, random.Bits());
  return image;
}

cv::Mat PanelTexture(std::uint64_t seed, double grey, int marks) {
  Random random(seed);
  cv::Mat image = Plain(256, 256, grey);
  Marks(image, marks, 22, random);
  AddNoise(image, 32, 2.5, random.Bits());
  for (int at = 0; at < 256; at += 64) {
    Box(image, at, 0, 1, 256, grey - 12);
    Box(image, 0, at, 256, 1, grey - 12);
  }
  return image;
}

cv::Mat DoorTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(128, 256, random.In(205, 230));  // the frame
  const double leaf = random.In(90, 150);
  Box(image, 8, 8, 112, 248, leaf);
  if (random.Unit() < 0.5) Box(image, 74, 26, 28, 90, leaf - 65);  // a pane
  Box(image, 14, 132, 16, 5, 235);                                 // the handle
  Box(image, 14, 120, 7, 30, 205);
  Box(image, 8, 228, 112, 20, leaf - 25);
  AddNoise(image, 64, 2, random.Bits());
  return image;
}

cv::Mat LampTexture() {
  cv::Mat image = Plain(64, 64, 250);
  cv::rectangle(image, cv::Rect(0, 0, 64, 64), cv::Scalar(170), 3);
  return image;
}

cv::Mat RadiatorTexture() {
  cv::Mat image = Plain(128, 64, 205);
  for (int x = 4; x < 128; x += 10) Box(image, x, 4, 3, 56, 150);
  return image;
}

cv::Mat WallpaperTexture(std::uint64_t seed) {
  Random random(seed);
  cv::Mat image = Plain(512, 512, random.In(150, 200));
  AddNoise(image, 64, 6, random.Bits());
  const int pitch = 64;
  const double tone = random.In(110, 140);
  for (int y = 0; y < 512; y += pitch) {  // a pattern that repeats: aliasing
    for (int x = 0; x < 512; x += pitch) {
      cv::circle(image, {x + 32, y + 32}, 9, cv::Scalar(tone), 3);
      cv::line(image, {x + 8, y + 4}, {x + 20, y + 16}, cv::Scalar(tone), 2);
    }
  }
  Box(image, 0, 488, 512, 24, 90);  // skirting board
  return image;
}

}  // namespace tutti::synthetic
