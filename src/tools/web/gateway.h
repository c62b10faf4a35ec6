/* SPDX-License-Identifier: Apache-2.0 */
/* What a file of the gateway's whole state has beside the drives' parameters. One thread. */
#ifndef DRIVEBRIDGE_WEB_GATEWAY_H
#define DRIVEBRIDGE_WEB_GATEWAY_H

#include "web/request.h"

/* For who may change the configuration or make users: answers with the configuration as texts,
 * users without passwords (for who makes them; else null), and names of certificates. It is a
 * record of the audit trail. */
void db_web_gateway(struct db_web_request *request);

#endif
