/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a request is meant for this gateway and was made by its own page. A page of somebody else that a name server
 * points to this address (DNS rebinding) calls it by another name; a page that sends a request across tells its own
 * origin. Pure.
 */
#ifndef DRIVEBRIDGE_WEB_ORIGIN_H
#define DRIVEBRIDGE_WEB_ORIGIN_H

#include "reader/settings.h"

#include <stdbool.h>

/* The head's Host: an address, localhost, or one of the names; with or without a port. NULL: there is none. */
bool db_web_host_is_good(const char *host, const struct db_setting_list *names);

/* The head's Origin, where there is one, against its Host. */
bool db_web_origin_is_good(const char *origin, const char *host);

#endif
