/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Carries out what include/drivebridge/edit.h says: the disk's thread reads, checks and writes the
 * files, the network thread compares with what runs and answers over the control socket. One at a
 * time. Internal to src/bridge/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_EDIT_H
#define DRIVEBRIDGE_SERVICE_EDIT_H

#include "drivebridge/edit.h"

struct service;

/* See struct db_control_socket_ops; of a struct service. 0: db_control_socket_edited() gets the
 * answer later. -EBUSY: another one, or a reload, is in progress; -EPERM: the configuration does
 * not allow to change it; or another negative errno. */
int edit_begin(void *context, const struct db_edit_request *request);

/* After the disk's thread has ended. */
void edit_end(struct service *service);

#endif
