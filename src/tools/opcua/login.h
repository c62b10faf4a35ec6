/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who logs in over OPC UA: users, their passwords, and how often these may be tried. One thread,
 * which waits while a password is compared.
 */
#ifndef DRIVEBRIDGE_OPCUA_LOGIN_H
#define DRIVEBRIDGE_OPCUA_LOGIN_H

#include "client/log.h"
#include "opcua/config.h"
#include "users/users.h"

#include <open62541/types.h>

/* For the file of users. */
extern const struct db_users_keeper db_opcua_keeper;

struct db_opcua_login {
	char user[DB_USERS_NAME_MAX + 1]; /* "": anonymous, or nobody that there is */
	bool named;                       /* with a name, which may be a password by mistake */
	struct db_grant grant;
	unsigned long digest; /* db_users_digest() of the user; 0: anonymous */
};

struct db_opcua_logins;

/* Both must outlive it. NULL without memory; the caller frees it. */
struct db_opcua_logins *db_opcua_logins_new(const struct db_opcua_config *config,
                                            struct db_client_log_rations *lines);

/* A round of the loop begins: after a wrong password no other is compared in the same one. */
void db_opcua_logins_begin(struct db_opcua_logins *logins);

/* BadUserAccessDenied: wrong password, no such user, or anonymous where that is not allowed;
 * BadTcpServerTooBusy: too many attempts. Who it is is set either way. */
UA_StatusCode db_opcua_logins_check(struct db_opcua_logins *logins, const char *address,
                                    bool is_signed, const UA_ExtensionObject *token,
                                    struct db_opcua_login *login);

#endif
