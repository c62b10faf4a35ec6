/* SPDX-License-Identifier: Apache-2.0 */
/* A call while it is carried out: its parameters by name. Network thread only. Internal to
 * src/bridge/control. */
#ifndef DRIVEBRIDGE_CONTROL_CALL_H
#define DRIVEBRIDGE_CONTROL_CALL_H

#include "control/session.h"
#include "regmap/named.h"

struct db_call {
	struct db_session *session;
	json_t *parameters; /* null: none */
};

/* The following answer the call with an error and return false on failure. An optional parameter
 * may be missing or null, and then the variable is unchanged. */
bool db_call_text(const struct db_call *call, const char *name, const char **text);
bool db_call_number(const struct db_call *call, const char *name, int64_t min, int64_t max,
                    int64_t *number);
bool db_call_optional_flag(const struct db_call *call, const char *name, bool *flag);
/* A whole number, or a text; *given: the parameter is there. */
bool db_call_optional_number(const struct db_call *call, const char *name, int64_t min, int64_t max,
                             int64_t *number, bool *given);
bool db_call_optional_text(const struct db_call *call, const char *name, const char **text);
bool db_call_object(const struct db_call *call, const char *name, bool optional, json_t **object);
/* An array of texts. */
bool db_call_texts(const struct db_call *call, const char *name, json_t **texts);
/* The drive named by the parameter `drive`; "" is the gateway where that is `allowed`, and then
 * only its number is set. *name is the given text. */
bool db_call_drive(const struct db_call *call, bool gateway, struct db_named_drive *drive,
                   const char **name);

#endif
