/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one table of what drivebridge-opcua's configuration may say, of which docs/opcua-keys.csv and the manual page are
 * made; the offsets are those of struct db_opcua_config. Pure.
 */
#ifndef DRIVEBRIDGE_OPCUA_KEYS_H
#define DRIVEBRIDGE_OPCUA_KEYS_H

#include "reader/settings.h"

extern const struct db_setting db_opcua_keys[];

#endif
