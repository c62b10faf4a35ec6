/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one table of what drivebridge-webd's configuration may say, of which docs/web-keys.csv and the manual page are
 * made; the offsets are those of struct db_web_config. Pure.
 */
#ifndef DRIVEBRIDGE_WEB_KEYS_H
#define DRIVEBRIDGE_WEB_KEYS_H

#include "reader/settings.h"

extern const struct db_setting db_web_keys[];

#endif
