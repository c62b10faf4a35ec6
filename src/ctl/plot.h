/* SPDX-License-Identifier: Apache-2.0 */
/* A record as a picture, by gnuplot. */
#ifndef DRIVEBRIDGE_CTL_PLOT_H
#define DRIVEBRIDGE_CTL_PLOT_H

#include "ctl/session.h"

/* Whether this can be a picture: "terminal" or a file with a name that ends with .svg. */
bool db_ctl_plot_is_picture(const char *picture);

/* The columns of a CSV file from the third on over the first one, which is in seconds. DB_CTL_OK, or the reason is
 * printed. */
enum db_ctl_status db_ctl_plot(const struct db_ctl *ctl, const char *csv, size_t columns,
                               const char *picture);

#endif
