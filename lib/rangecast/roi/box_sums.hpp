/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

namespace rangecast {

/** Sums over a square window around each pixel, row by row: cv::boxFilter() without planes of
 * values. Its memory only grows.
 *  @tparam T  type of a window's sum; floats are rounded */
template <typename T> class BoxSums {
public:
  /** Calls use (y, sums) for each row.
   *  @param reach   radius of the window, pixels
   *  @param border  values beyond the image, as of cv::boxFilter(); cv::BORDER_CONSTANT: 0
   *  @param load    load (y, values) writes the values of a row; called twice for each row or more
   */
  template <typename Load, typename Use>
  void find (const cv::Size &size, int reach, int border, const Load &load, const Use &use)
  {
    const int n = size.width + 2 * reach;
    columns_.assign (std::size_t (n), T (0));
    for (std::vector<T> *row : {&values_, &doubled_, &sums_})
      row->resize (std::size_t (n));
    T *columns = columns_.data () + reach;
    const auto for_row = [&] (int y, const auto &change) {
      if (const int inside = cv::borderInterpolate (y, size.height, border); inside >= 0) {
        load (inside, values_.data ());
        change (columns, values_.data (), size.width);
      }
    };
    for (int y = -reach; y < reach; y++)
      for_row (y, add);
    for (int y = 0; y < size.height; y++) {
      for_row (y + reach, add);
      for (int k = 1; k <= reach && border != cv::BORDER_CONSTANT; k++) {
        columns[-k] = columns[cv::borderInterpolate (-k, size.width, border)];
        columns[size.width - 1 + k] =
            columns[cv::borderInterpolate (size.width - 1 + k, size.width, border)];
      }
      sum_columns (2 * reach + 1, n);
      use (y, static_cast<const T *> (sums_.data ()));
      for_row (y - reach, subtract);
    }
  }

private:
  static void add (T *__restrict to, const T *__restrict values, int n)
  {
    for (int x = 0; x < n; x++)
      to[x] = T (to[x] + values[x]);
  }
  static void subtract (T *__restrict from, const T *__restrict values, int n)
  {
    for (int x = 0; x < n; x++)
      from[x] = T (from[x] - values[x]);
  }
  /* From columns_ to sums_: sums of `side` columns, as those of powers of two. */
  void sum_columns (int side, int n)
  {
    T *__restrict sums = sums_.data (), *from = columns_.data (), *to = doubled_.data ();
    for (int power = 1, done = 0; power <= side; power *= 2) {
      if (side & power) {
        const int last = n - done - power;
        for (int x = 0; x <= last; x++)
          sums[x] = done ? T (sums[x] + from[x + done]) : from[x];
        done += power;
      }
      double_sums (from, power, n - 2 * power, to);
      from = to;
      to = from == doubled_.data () ? values_.data () : doubled_.data ();
    }
  }
  /* Sums of twice as many columns. */
  static void double_sums (const T *__restrict from, int power, int last, T *__restrict to)
  {
    for (int x = 0; x <= last; x++)
      to[x] = T (from[x] + from[x + power]);
  }

  std::vector<T> columns_, values_, doubled_, sums_;
};

} // namespace rangecast
