/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How it goes, in one line for `systemctl status`. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_STATUS_H
#define DRIVEBRIDGE_SERVICE_STATUS_H

#include <stdbool.h>

struct service;

/* From now on systemd is told whenever the line changes, about a second later. Does nothing where nobody
 * listens. 0 or a negative errno. */
int status_begin(struct service *service);

/* Whether the last reload was refused, which stands in the line until one is carried out. */
void status_reloaded(struct service *service, bool refused);

void status_end(struct service *service);

#endif
