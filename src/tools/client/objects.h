/* SPDX-License-Identifier: Apache-2.0 */
/* Looking into the service's objects. Pure. */
#ifndef DRIVEBRIDGE_CLIENT_OBJECTS_H
#define DRIVEBRIDGE_CLIENT_OBJECTS_H

#include <jansson.h>
#include <stdbool.h>

/* The text of an object's member, "" without one. */
const char *db_client_text(const json_t *object, const char *key);

/* The object with this `name` in an array; NULL: there is none. */
json_t *db_client_named(const json_t *objects, const char *name);

/* True if this text is in an array. */
bool db_client_has_text(const json_t *texts, const char *text);

#endif
